package org.visavis.demo;

import android.content.Context;
import android.graphics.Canvas;
import android.graphics.Color;
import android.graphics.Paint;
import android.view.MotionEvent;
import android.view.View;
import org.visavis.FrameLayout;
import org.visavis.Skeleton;

/** The agent, the floor, the user as a head above a disc, and the line of sight between the two. Dragging moves the user. */
final class StageView extends View {
    /** From drawing to the picture on the screen, two frames at 72 Hz: that much ahead of the voice the pose is taken. Seconds. */
    static final double SCREEN_DELAY = 0.028;
    /** The camera follows the agent so slowly that steps do not shake it, seconds. */
    private static final float FOLLOW = 1.5f;
    private static final int GRID = Color.rgb(52, 57, 72);
    private static final int GRID_WIDE = Color.rgb(70, 77, 98);

    private final Motion motion;
    private final Life life;
    private final Figure figure;
    private final FrameLayout layout;
    private final float[] frame;
    private final Drag drag;
    private final Paint paint = new Paint(Paint.ANTI_ALIAS_FLAG);
    private final float[] a = new float[3];
    private final float[] b = new float[3];
    private final float[] user = new float[2];
    private Projection view = new Projection(1, 1, 0, 0, 0, 0);
    private double shown = Double.NaN;
    private long drawn;

    StageView(Context context, Motion motion, Skeleton skeleton, Life life) {
        super(context);
        this.motion = motion;
        this.life = life;
        layout = motion.frames().layout();
        figure = new Figure(skeleton, layout);
        frame = new float[layout.frameFloats()];
        drag = new Drag(Ui.dp(context, 40));
        setContentDescription(context.getString(R.string.drag));
    }

    @Override
    protected void onSizeChanged(int width, int height, int oldWidth, int oldHeight) {
        super.onSizeChanged(width, height, oldWidth, oldHeight);
        Projection next = new Projection(width, height, 0, 0, 0, 0);
        next.centre(view.centreX(), view.centreZ());
        view = next;
        drag.end();
    }

    @Override
    public boolean onTouchEvent(MotionEvent event) {
        user[0] = motion.userX();
        user[1] = motion.userZ();
        switch (event.getActionMasked()) {
            case MotionEvent.ACTION_DOWN:
                drag.begin(view, event.getX(), event.getY(), user);
                break;
            case MotionEvent.ACTION_MOVE:
                drag.move(view, event.getX(), event.getY(), user);
                break;
            default:
                drag.end();
        }
        motion.moveUser(user[0], user[1]);
        invalidate();
        return true;
    }

    /** Session second of the pose that was drawn last; NaN before the first. */
    double shown() {
        return shown;
    }

    @Override
    protected void onDraw(Canvas canvas) {
        super.onDraw(canvas);
        long now = System.nanoTime();
        shown = motion.frames().pose(motion.clock().heardSoon(now, SCREEN_DELAY), frame);
        boolean there = !Double.isNaN(shown);
        if (there && !drag.active()) {
            follow((now - drawn) * 1e-9f);
        }
        drawn = now;
        drawFloor(canvas);
        if (there) {
            drawShadow(canvas, frame[FrameLayout.ROOT], frame[FrameLayout.ROOT + 1], 0.3f);
        }
        drawShadow(canvas, motion.userX(), motion.userZ(), 0.12f);
        if (there) {
            figure.draw(canvas, view, frame);
        }
        drawUser(canvas, there);
        if (!there && life.runs()) {
            message(canvas, getContext().getString(R.string.starting));
        }
        if (life.runs()) {
            postInvalidateOnAnimation();
        }
    }

    /** The middle of the stage goes after the agent; the user goes along, as someone who walks beside it. */
    private void follow(float seconds) {
        float share = 1 - (float) Math.exp(-Math.min(1, Math.max(0, seconds)) / FOLLOW);
        view.centre(view.centreX() + share * (frame[FrameLayout.ROOT] - view.centreX()),
                view.centreZ() + share * (frame[FrameLayout.ROOT + 1] - view.centreZ()));
        user[0] = motion.userX();
        user[1] = motion.userZ();
        view.clampToReach(user);
        motion.moveUser(user[0], user[1]);
    }

    private void drawFloor(Canvas canvas) {
        canvas.drawColor(Ui.BACKGROUND);
        paint.setStrokeCap(Paint.Cap.BUTT);
        int atX = Math.round(view.centreX());
        int atZ = Math.round(view.centreZ());
        for (int i = -8; i <= 10; i++) {
            boolean wide = i % 2 == 0;
            paint.setColor(wide ? GRID_WIDE : GRID);
            paint.setStrokeWidth(Math.max(1, getHeight() / (wide ? 600f : 1000f)));
            line(canvas, atX + 0.5f * i, atZ - 4, atX + 0.5f * i, atZ + 5);
            line(canvas, atX - 4, atZ + 0.5f * i, atX + 5, atZ + 0.5f * i);
        }
    }

    private void line(Canvas canvas, float x0, float z0, float x1, float z1) {
        view.project(x0, 0, z0, a);
        view.project(x1, 0, z1, b);
        canvas.drawLine(a[0], a[1], b[0], b[1], paint);
    }

    private void drawShadow(Canvas canvas, float x, float z, float radius) {
        view.project(x, 0, z, a);
        paint.setColor(Color.argb(90, 0, 0, 0));
        ellipse(canvas, x, z, radius);
    }

    /** A disc on the floor, as wide and as flat as it is seen. */
    private void ellipse(Canvas canvas, float x, float z, float radius) {
        view.project(x, 0, z, a);
        view.project(x, 0, z - radius, b);
        float up = a[1] - b[1];
        view.project(x, 0, z + radius, b);
        up = Math.max(up, b[1] - a[1]);
        float side = radius * a[2];
        canvas.drawOval(a[0] - side, a[1] - up, a[0] + side, a[1] + up, paint);
    }

    private void drawUser(Canvas canvas, boolean there) {
        float x = motion.userX();
        float z = motion.userZ();
        paint.setColor(drag.active() ? Ui.USER : Color.argb(150, 186, 120, 226));
        ellipse(canvas, x, z, 0.17f);
        paint.setColor(Ui.BACKGROUND);
        ellipse(canvas, x, z, 0.13f);
        paint.setColor(Ui.USER);
        ellipse(canvas, x, z, 0.045f);
        view.project(x, 0, z, a);
        view.project(x, Projection.HEAD, z, b);
        paint.setStrokeWidth(Math.max(1, b[2] / 150));
        canvas.drawLine(a[0], a[1], b[0], b[1], paint);
        if (there) {
            float gaze = frame[FrameLayout.GAZE];
            figure.head(view, frame, a);
            paint.setColor(gaze > 0.9f ? Ui.GOOD : Ui.DIM);
            paint.setStrokeWidth(Math.max(1.5f, b[2] / 90));
            canvas.drawLine(a[0], a[1], b[0], b[1], paint);
        }
        paint.setColor(Color.rgb(206, 214, 232));
        canvas.drawCircle(b[0], b[1], 0.1f * b[2], paint);
        paint.setColor(Ui.USER);
        canvas.drawCircle(b[0], b[1], 0.06f * b[2], paint);
    }

    private void message(Canvas canvas, String text) {
        paint.setColor(Ui.TEXT);
        paint.setTextSize(Ui.dp(getContext(), 18));
        canvas.drawText(text, (getWidth() - paint.measureText(text)) / 2, getHeight() / 2f, paint);
    }
}
