package org.visavis.demo;

import android.opengl.GLSurfaceView;
import javax.microedition.khronos.egl.EGL10;
import javax.microedition.khronos.egl.EGLConfig;
import javax.microedition.khronos.egl.EGLDisplay;

/** A surface with 8 bits a colour, depth, and four samples a pixel where there are any. */
final class Samples implements GLSurfaceView.EGLConfigChooser {
    private static final int ES3 = 0x40; // EGL_OPENGL_ES3_BIT_KHR

    @Override
    public EGLConfig chooseConfig(EGL10 egl, EGLDisplay display) {
        for (int samples = 4; samples >= 0; samples -= 4) {
            int[] wanted = {
                EGL10.EGL_RED_SIZE, 8, EGL10.EGL_GREEN_SIZE, 8, EGL10.EGL_BLUE_SIZE, 8, EGL10.EGL_DEPTH_SIZE, 16,
                EGL10.EGL_RENDERABLE_TYPE, ES3, EGL10.EGL_SAMPLE_BUFFERS, samples / 4, EGL10.EGL_SAMPLES, samples, EGL10.EGL_NONE,
            };
            EGLConfig[] found = new EGLConfig[1];
            int[] count = new int[1];
            if (egl.eglChooseConfig(display, wanted, found, 1, count) && count[0] > 0) {
                return found[0];
            }
        }
        throw new IllegalArgumentException("this device has no OpenGL ES 3.0");
    }
}
