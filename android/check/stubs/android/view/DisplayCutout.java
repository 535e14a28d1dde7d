package android.view;

public final class DisplayCutout {
    private final int[] safe;

    DisplayCutout(int left, int top, int right, int bottom) {
        safe = new int[] {left, top, right, bottom};
    }

    public int getSafeInsetLeft() {
        return safe[0];
    }

    public int getSafeInsetTop() {
        return safe[1];
    }

    public int getSafeInsetRight() {
        return safe[2];
    }

    public int getSafeInsetBottom() {
        return safe[3];
    }
}
