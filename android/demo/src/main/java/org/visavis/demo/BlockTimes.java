package org.visavis.demo;

import java.util.Arrays;
import java.util.Locale;
import org.visavis.FrameLayout;

/** Times of the last blocks, milliseconds. One thread adds, any thread looks. */
final class BlockTimes {
    /** Milliseconds that a block lasts. */
    static final float DEADLINE = 1000 * FrameLayout.FRAMES / 30f;

    private final float[] times;
    private long count;

    BlockTimes(int room) {
        times = new float[room];
    }

    synchronized void add(float milliseconds) {
        times[(int) (count++ % times.length)] = milliseconds;
    }

    synchronized long count() {
        return count;
    }

    int room() {
        return times.length;
    }

    /** Copies the times, oldest first, to the end of {@code out}; returns how many there are. */
    synchronized int copy(float[] out) {
        int kept = (int) Math.min(count, times.length);
        for (int i = 0; i < kept; i++) {
            out[out.length - kept + i] = times[(int) ((count - kept + i) % times.length)];
        }
        return kept;
    }

    /** Median, 95th percentile and maximum; zeros before the first block. */
    float[] ranks() {
        float[] sorted = new float[times.length];
        int kept = copy(sorted);
        sorted = Arrays.copyOfRange(sorted, sorted.length - kept, sorted.length);
        Arrays.sort(sorted);
        return new float[] {rank(sorted, 0.5), rank(sorted, 0.95), rank(sorted, 1)};
    }

    /** Value of a rank (0 to 1] of sorted values. */
    static float rank(float[] sorted, double p) {
        return sorted.length == 0 ? 0 : sorted[Math.max(1, (int) Math.ceil(p * sorted.length)) - 1];
    }

    /** For the user: block times, and how many times faster than real time that is. */
    String says() {
        float[] ranks = ranks();
        if (ranks[0] == 0) {
            return "No block yet";
        }
        return String.format(Locale.ROOT, "Block %.1f ms, worst %.1f of %.0f; %.1f x real time", ranks[0], ranks[2], DEADLINE, DEADLINE / ranks[0]);
    }
}
