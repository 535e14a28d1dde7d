package org.visavis.demo;

import android.content.Context;
import android.graphics.Canvas;
import android.graphics.Color;
import android.graphics.Paint;
import android.view.MotionEvent;
import android.view.View;
import java.util.Locale;
import org.visavis.FrameLayout;
import org.visavis.Skeleton;

/**
 * The stage: the agent as bones, the user as a disc with the line of sight between them, seen over the user's shoulder; below, the times of
 * the last blocks. Dragging moves the user.
 */
final class StageView extends View {
    private static final float DEADLINE_MS = 1000 * FrameLayout.FRAMES / 30f;

    private final Motion motion;
    private final Skeleton skeleton;
    private final FrameLayout layout;
    private final Paint paint = new Paint(Paint.ANTI_ALIAS_FLAG);
    private final float[] frames;
    private final float[] times = new float[Motion.times()];
    private int blocks;
    private long since;

    StageView(Context context, Motion motion, Skeleton skeleton, FrameLayout layout) {
        super(context);
        this.motion = motion;
        this.skeleton = skeleton;
        this.layout = layout;
        this.frames = new float[motion.floats()];
    }

    @Override
    public boolean onTouchEvent(MotionEvent event) {
        float x = 4 * event.getX() / getWidth() - 2;
        float z = 3.5f * (event.getY() / getHeight());
        motion.moveUser(-x, Math.max(0.6f, z));
        return true;
    }

    /** Perspective from 4.5 m in front of the agent, 1.9 m up: right of the screen is the agent's left. */
    private float screenX(float x, float z) {
        return getWidth() * (0.5f + 0.42f * -x / (1 - z / 4.5f) / 1.6f);
    }

    private float screenY(float y, float z) {
        return getHeight() * 0.62f - getWidth() * 0.3f * (y - 0.9f) / (1 - Math.min(z, 4) / 4.5f);
    }

    @Override
    protected void onDraw(Canvas canvas) {
        super.onDraw(canvas);
        int now = motion.snapshot(frames, times);
        if (now != blocks) {
            blocks = now;
            since = System.nanoTime();
        }
        canvas.drawColor(Color.rgb(24, 26, 32));
        if (blocks > 0) {
            int frame = (int) Math.min(FrameLayout.FRAMES - 1, (System.nanoTime() - since) * 30 / 1_000_000_000L);
            drawAgent(canvas, frame);
            drawTimes(canvas);
        }
        postInvalidateOnAnimation();
    }

    private void drawAgent(Canvas canvas, int frame) {
        paint.setColor(Color.rgb(230, 200, 160));
        paint.setStrokeWidth(getWidth() / 60f);
        paint.setStrokeCap(Paint.Cap.ROUND);
        for (int j = 1; j < skeleton.size(); j++) {
            int to = layout.joint(frame, j) + FrameLayout.POSITION;
            int from = layout.joint(frame, skeleton.parent(j)) + FrameLayout.POSITION;
            canvas.drawLine(screenX(frames[from], frames[from + 2]), screenY(frames[from + 1], frames[from + 2]),
                    screenX(frames[to], frames[to + 2]), screenY(frames[to + 1], frames[to + 2]), paint);
        }
        int head = layout.joint(frame, skeleton.indexOf("head")) + FrameLayout.POSITION;
        float headX = screenX(frames[head], frames[head + 2]);
        float headY = screenY(frames[head + 1] + 0.08f, frames[head + 2]);
        canvas.drawCircle(headX, headY, getWidth() / 28f, paint);

        float userX = screenX(motion.userX(), motion.userZ());
        float userY = screenY(1.65f, motion.userZ());
        float gaze = frames[layout.frame(frame) + FrameLayout.GAZE];
        paint.setStrokeWidth(getWidth() / 300f);
        paint.setColor(gaze > 0.9f ? Color.rgb(120, 220, 140) : Color.rgb(120, 120, 130));
        canvas.drawLine(headX, headY, userX, userY, paint);
        paint.setColor(Color.rgb(110, 160, 240));
        canvas.drawCircle(userX, userY, getWidth() / 30f, paint);
    }

    private void drawTimes(Canvas canvas) {
        float bottom = getHeight() - 8;
        float height = getHeight() / 8f;
        float step = getWidth() / (float) times.length;
        paint.setStrokeWidth(step * 0.7f);
        float sum = 0;
        int count = Math.min(blocks, times.length);
        for (int i = 0; i < times.length; i++) {
            paint.setColor(times[i] > DEADLINE_MS ? Color.RED : Color.rgb(120, 220, 140));
            canvas.drawLine((i + 0.5f) * step, bottom, (i + 0.5f) * step, bottom - height * Math.min(1, times[i] / DEADLINE_MS), paint);
            sum += times[i];
        }
        paint.setColor(Color.WHITE);
        paint.setTextSize(getWidth() / 28f);
        float mean = sum / Math.max(1, count);
        String text = String.format(Locale.ROOT, "block %.1f ms of %.0f, %.1f x real time  %s", mean, DEADLINE_MS, DEADLINE_MS / Math.max(mean, 0.01f),
                motion.note());
        canvas.drawText(text, 12, bottom - height - 12, paint);
    }
}
