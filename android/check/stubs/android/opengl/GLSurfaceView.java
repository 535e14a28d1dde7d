package android.opengl;

import android.content.Context;
import android.graphics.Canvas;
import android.graphics.StandInPicture;
import android.view.SurfaceView;
import javax.microedition.khronos.egl.EGL10;
import javax.microedition.khronos.egl.EGLConfig;
import javax.microedition.khronos.egl.EGLDisplay;
import javax.microedition.khronos.opengles.GL10;

/** Draws with this machine's OpenGL where the tests have it, and nothing elsewhere. */
public class GLSurfaceView extends SurfaceView {
    public static final int RENDERMODE_WHEN_DIRTY = 0;
    public static final int RENDERMODE_CONTINUOUSLY = 1;

    private Renderer renderer;
    private int mode = RENDERMODE_CONTINUOUSLY;

    public interface Renderer {
        void onSurfaceCreated(GL10 gl, EGLConfig config);

        void onSurfaceChanged(GL10 gl, int width, int height);

        void onDrawFrame(GL10 gl);
    }

    public interface EGLConfigChooser {
        EGLConfig chooseConfig(EGL10 egl, EGLDisplay display);
    }

    public GLSurfaceView(Context context) {
        super(context);
    }

    public void setEGLContextClientVersion(int version) {}

    public void setEGLConfigChooser(EGLConfigChooser chooser) {
        StandInGl.ask(chooser);
    }

    public void setPreserveEGLContextOnPause(boolean preserve) {}

    public void setRenderer(Renderer renderer) {
        this.renderer = renderer;
    }

    public void setRenderMode(int mode) {
        this.mode = mode;
    }

    public int getRenderMode() {
        return mode;
    }

    public void requestRender() {}

    public void onPause() {}

    public void onResume() {}

    @Override
    protected void onDraw(Canvas canvas) {
        if (!StandInGl.there()) {
            return;
        }
        int[] pixels = new int[getWidth() * getHeight()];
        StandInGl.begin(getWidth(), getHeight());
        renderer.onSurfaceCreated(null, null);
        renderer.onSurfaceChanged(null, getWidth(), getHeight());
        renderer.onDrawFrame(null);
        StandInGl.end(getWidth(), getHeight(), pixels);
        StandInPicture.put(canvas, getWidth(), getHeight(), pixels);
    }
}
