package org.visavis.demo;

import java.nio.FloatBuffer;
import org.visavis.FrameLayout;

/** The newest blocks of motion, from which a view takes the pose of a moment. One thread adds, any thread looks. */
final class FrameQueue {
    /** Blocks that are kept, 1.6 seconds: more than a view lags behind. */
    private static final int BLOCKS = 12;
    static final double FPS = 30;

    private final FrameLayout layout;
    private final float[] frames;
    private long count; // frames so far

    FrameQueue(FrameLayout layout) {
        this.layout = layout;
        frames = new float[BLOCKS * layout.blockFloats()];
    }

    FrameLayout layout() {
        return layout;
    }

    /** Adds a block: what {@code block} has from its start on. */
    synchronized void add(FloatBuffer block) {
        int slot = (int) (count / FrameLayout.FRAMES % BLOCKS);
        block.duplicate().get(frames, slot * layout.blockFloats(), layout.blockFloats());
        count += FrameLayout.FRAMES;
    }

    synchronized void clear() {
        count = 0;
    }

    /** Session second up to which there is motion. */
    synchronized double end() {
        return count / FPS;
    }

    /**
     * The pose at a session second into {@code out} (of a frame's floats), between frames by interpolation of root, hips and joints' positions; the
     * nearest pose where there is none for that moment. Returns the second of the pose, or NaN before the first block.
     */
    synchronized double pose(double second, float[] out) {
        if (count == 0) {
            return Double.NaN;
        }
        long first = Math.max(0, count - (long) BLOCKS * FrameLayout.FRAMES);
        double place = Math.max(first, Math.min(count - 1, second * FPS));
        long index = (long) place;
        float part = (float) (place - index);
        int a = slot(index);
        int b = slot(Math.min(count - 1, index + 1));
        System.arraycopy(frames, part < 0.5f ? a : b, out, 0, layout.frameFloats());
        blend(a, b, part, FrameLayout.ROOT, 2, out);
        blend(a, b, part, FrameLayout.HIPS, 3, out);
        for (int at = layout.joint(0, 0); at < layout.frameFloats(); at += layout.joint(0, 1) - layout.joint(0, 0)) {
            blend(a, b, part, at + FrameLayout.POSITION, 3, out);
            turn(a, b, part, at + FrameLayout.LOCAL, out);
            turn(a, b, part, at + FrameLayout.ROTATION, out);
        }
        return place / FPS;
    }

    private int slot(long frame) {
        return (int) (frame % ((long) BLOCKS * FrameLayout.FRAMES)) * layout.frameFloats();
    }

    private void blend(int a, int b, float part, int at, int floats, float[] out) {
        for (int i = at; i < at + floats; i++) {
            out[i] = frames[a + i] + part * (frames[b + i] - frames[a + i]);
        }
    }

    /** Normalised sum of two quaternions, the shorter way. */
    private void turn(int a, int b, float part, int at, float[] out) {
        float dot = 0;
        for (int i = at; i < at + 4; i++) {
            dot += frames[a + i] * frames[b + i];
        }
        float other = dot < 0 ? -part : part;
        float square = 0;
        for (int i = at; i < at + 4; i++) {
            out[i] = (1 - part) * frames[a + i] + other * frames[b + i];
            square += out[i] * out[i];
        }
        float unit = 1 / (float) Math.sqrt(Math.max(1e-12f, square));
        for (int i = at; i < at + 4; i++) {
            out[i] *= unit;
        }
    }
}
