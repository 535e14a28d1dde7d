package org.visavis.demo;

import android.content.Context;
import android.opengl.GLSurfaceView;
import android.view.MotionEvent;
import javax.microedition.khronos.egl.EGLConfig;
import javax.microedition.khronos.opengles.GL10;
import org.visavis.FrameLayout;
import org.visavis.Skeleton;

/** The agent, the floor, the user as a head above a disc, and the line of sight between the two. Dragging moves the user. */
final class StageView extends GLSurfaceView implements GLSurfaceView.Renderer {
    /** From drawing to the picture on the screen, two frames at 72 Hz: that much ahead of the voice the pose is taken. Seconds. */
    static final double SCREEN_DELAY = 0.028;
    /** The camera follows the agent so slowly that steps do not shake it, seconds. */
    private static final float FOLLOW = 1.5f;

    private final Motion motion;
    private final Life life;
    private final Scene scene;
    private final float[] frame;
    private final Drag drag;
    private final float[] dragged = new float[2];
    private final float[] walked = new float[2];
    private volatile Projection view = new Projection(1, 1, 0, 0, 0, 0);
    private int width = 1;
    private int height = 1;
    private long drawn;

    StageView(Context context, Motion motion, Skeleton skeleton, Life life, StageData data) {
        super(context);
        this.motion = motion;
        this.life = life;
        FrameLayout layout = motion.frames().layout();
        scene = new Scene(data, skeleton, layout);
        frame = new float[layout.frameFloats()];
        drag = new Drag(Ui.dp(context, 40));
        setContentDescription(context.getString(R.string.drag));
        setEGLContextClientVersion(3);
        setEGLConfigChooser(new Samples());
        setPreserveEGLContextOnPause(true);
        setRenderer(this);
    }

    /** Draws all the time while the conversation runs, and only when it is asked to otherwise. */
    void refresh() {
        setRenderMode(life.runs() ? RENDERMODE_CONTINUOUSLY : RENDERMODE_WHEN_DIRTY);
        requestRender();
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
        dragged[0] = motion.userX();
        dragged[1] = motion.userZ();
        switch (event.getActionMasked()) {
            case MotionEvent.ACTION_DOWN:
                drag.begin(view, event.getX(), event.getY(), dragged);
                break;
            case MotionEvent.ACTION_MOVE:
                drag.move(view, event.getX(), event.getY(), dragged);
                break;
            default:
                drag.end();
        }
        motion.moveUser(dragged[0], dragged[1]);
        requestRender();
        return true;
    }

    @Override
    public void onSurfaceCreated(GL10 unused, EGLConfig config) {
        try {
            scene.create();
        } catch (RuntimeException e) {
            life.failed(Failure.of("drawing the stage", e));
        }
    }

    @Override
    public void onSurfaceChanged(GL10 unused, int width, int height) {
        this.width = width;
        this.height = height;
    }

    @Override
    public void onDrawFrame(GL10 unused) {
        Projection now = view;
        long time = System.nanoTime();
        boolean there = !Double.isNaN(motion.frames().pose(motion.clock().heardSoon(time, SCREEN_DELAY), frame));
        if (there && !drag.active()) {
            follow(now, (time - drawn) * 1e-9f);
        }
        drawn = time;
        scene.draw(now, width, height, there ? frame : null, motion.userX(), motion.userZ(), drag.active());
    }

    /** The middle of the stage goes after the agent; the user goes along, as someone who walks beside it. */
    private void follow(Projection view, float seconds) {
        float share = 1 - (float) Math.exp(-Math.min(1, Math.max(0, seconds)) / FOLLOW);
        view.centre(view.centreX() + share * (frame[FrameLayout.ROOT] - view.centreX()),
                view.centreZ() + share * (frame[FrameLayout.ROOT + 1] - view.centreZ()));
        walked[0] = motion.userX();
        walked[1] = motion.userZ();
        view.clampToReach(walked);
        if (!drag.active()) {
            motion.moveUser(walked[0], walked[1]);
        }
    }
}
