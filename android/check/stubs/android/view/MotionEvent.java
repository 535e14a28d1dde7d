package android.view;

public final class MotionEvent {
    public float getX() {
        return 0;
    }

    public float getY() {
        return 0;
    }
}
