package android.view;

/** The system's side of a window: sizes, insets, touches. */
public final class StandInWindow {
    private StandInWindow() {}

    public static void lay(View view, int width, int height) {
        view.measure(View.MeasureSpec.makeMeasureSpec(width, View.MeasureSpec.EXACTLY), View.MeasureSpec.makeMeasureSpec(height, View.MeasureSpec.EXACTLY));
        view.layout(0, 0, width, height);
    }

    /** System bars above and below, and a cutout at the left. */
    public static void insets(View view, int top, int bottom, int cutout) {
        view.onApplyWindowInsets(new WindowInsets(0, top, 0, bottom, new DisplayCutout(cutout, 0, 0, 0)));
    }

    /** What a finger does at a place of a view. */
    public static void touch(View view, int action, float x, float y) {
        view.onTouchEvent(new MotionEvent(action, x, y));
    }

    public static int left(View view) {
        return view.left;
    }

    public static int top(View view) {
        return view.top;
    }
}
