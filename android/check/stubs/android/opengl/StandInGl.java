package android.opengl;

import javax.microedition.khronos.egl.EGL10;
import javax.microedition.khronos.egl.EGLConfig;
import javax.microedition.khronos.egl.EGLDisplay;

/** OpenGL ES of this machine, without a window: android/check/gl.c, if the system property visavis.gl names it. */
public final class StandInGl {
    private static final String LIBRARY = System.getProperty("visavis.gl", "");

    static {
        if (there()) {
            System.load(LIBRARY);
        }
    }

    private StandInGl() {}

    public static boolean there() {
        return !LIBRARY.isEmpty();
    }

    static native void begin(int width, int height);

    /** The picture as ARGB, its upper row first. */
    static native void end(int width, int height, int[] pixels);

    /** As a device with several samples a pixel, then as one without, would be asked. */
    static void ask(GLSurfaceView.EGLConfigChooser chooser) {
        for (boolean many : new boolean[] {true, false}) {
            EGLConfig chosen = chooser.chooseConfig((display, wanted, configs, size, count) -> {
                for (int i = 0; wanted[i] != EGL10.EGL_NONE; i += 2) {
                    if (wanted[i] == EGL10.EGL_SAMPLES && wanted[i + 1] > 0 && !many) {
                        return true;
                    }
                }
                configs[0] = new EGLConfig() {};
                count[0] = 1;
                return true;
            }, new EGLDisplay() {});
            if (chosen == null) {
                throw new AssertionError("no config was chosen");
            }
        }
    }
}
