package javax.microedition.khronos.egl;

public abstract class EGLDisplay {
    public EGLDisplay() {}
}
