package android.view;

public final class WindowInsets {
    private final int[] bars;
    private final DisplayCutout cutout;

    WindowInsets(int left, int top, int right, int bottom, DisplayCutout cutout) {
        bars = new int[] {left, top, right, bottom};
        this.cutout = cutout;
    }

    public int getSystemWindowInsetLeft() {
        return bars[0];
    }

    public int getSystemWindowInsetTop() {
        return bars[1];
    }

    public int getSystemWindowInsetRight() {
        return bars[2];
    }

    public int getSystemWindowInsetBottom() {
        return bars[3];
    }

    public DisplayCutout getDisplayCutout() {
        return cutout;
    }

    public WindowInsets consumeSystemWindowInsets() {
        return new WindowInsets(0, 0, 0, 0, cutout);
    }
}
