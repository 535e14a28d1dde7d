package javax.microedition.khronos.egl;

public interface EGL10 extends EGL {
    int EGL_RED_SIZE = 12324;
    int EGL_GREEN_SIZE = 12323;
    int EGL_BLUE_SIZE = 12322;
    int EGL_DEPTH_SIZE = 12325;
    int EGL_RENDERABLE_TYPE = 12352;
    int EGL_SAMPLE_BUFFERS = 12338;
    int EGL_SAMPLES = 12337;
    int EGL_NONE = 12344;

    boolean eglChooseConfig(EGLDisplay display, int[] attributes, EGLConfig[] configs, int size, int[] count);
}
