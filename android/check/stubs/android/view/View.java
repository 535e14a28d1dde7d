package android.view;

import android.content.Context;
import android.content.res.Resources;
import android.graphics.Canvas;
import android.graphics.Paint;
import android.os.StandInLooper;

public class View {
    public static final int VISIBLE = 0;
    public static final int GONE = 8;

    public interface OnClickListener {
        void onClick(View view);
    }

    public static class MeasureSpec {
        public static final int UNSPECIFIED = 0;
        public static final int EXACTLY = 1073741824;
        public static final int AT_MOST = -2147483648;

        public MeasureSpec() {}

        public static int makeMeasureSpec(int size, int mode) {
            return size & 0x3fffffff | mode;
        }

        public static int getSize(int spec) {
            return spec & 0x3fffffff;
        }

        public static int getMode(int spec) {
            return spec & 0xc0000000;
        }
    }

    int left;
    int top;
    private final Context context;
    private final int[] padding = new int[4];
    private int right;
    private int bottom;
    private int measuredWidth;
    private int measuredHeight;
    private int minimumHeight;
    private int background;
    private int visibility;
    private boolean keepsScreenOn;
    private OnClickListener listener;
    private ViewGroup.LayoutParams place;

    public View(Context context) {
        this.context = context;
    }

    public final Context getContext() {
        return context;
    }

    public Resources getResources() {
        return context.getResources();
    }

    public final int getWidth() {
        return right - left;
    }

    public final int getHeight() {
        return bottom - top;
    }

    public final int getMeasuredWidth() {
        return measuredWidth;
    }

    public final int getMeasuredHeight() {
        return measuredHeight;
    }

    public void setPadding(int left, int top, int right, int bottom) {
        padding[0] = left;
        padding[1] = top;
        padding[2] = right;
        padding[3] = bottom;
    }

    public int getPaddingLeft() {
        return padding[0];
    }

    public int getPaddingTop() {
        return padding[1];
    }

    public int getPaddingRight() {
        return padding[2];
    }

    public int getPaddingBottom() {
        return padding[3];
    }

    public void setMinimumHeight(int height) {
        minimumHeight = height;
    }

    public int getMinimumHeight() {
        return minimumHeight;
    }

    public void setBackgroundColor(int color) {
        background = color;
    }

    public void setVisibility(int visibility) {
        this.visibility = visibility;
    }

    public int getVisibility() {
        return visibility;
    }

    public void setKeepScreenOn(boolean on) {
        keepsScreenOn = on;
    }

    public boolean getKeepScreenOn() {
        return keepsScreenOn;
    }

    public void setContentDescription(CharSequence text) {}

    public void setLayoutParams(ViewGroup.LayoutParams place) {
        this.place = place;
    }

    public ViewGroup.LayoutParams getLayoutParams() {
        return place;
    }

    public void setOnClickListener(OnClickListener listener) {
        this.listener = listener;
    }

    public boolean performClick() {
        if (listener != null) {
            listener.onClick(this);
        }
        return listener != null;
    }

    public boolean onTouchEvent(MotionEvent event) {
        return false;
    }

    public WindowInsets onApplyWindowInsets(WindowInsets insets) {
        return insets;
    }

    public void invalidate() {}

    public void postInvalidateOnAnimation() {}

    public boolean postDelayed(Runnable action, long millis) {
        StandInLooper.post(action, millis);
        return true;
    }

    public final void measure(int widthSpec, int heightSpec) {
        onMeasure(widthSpec, heightSpec);
    }

    protected void onMeasure(int widthSpec, int heightSpec) {
        int height = MeasureSpec.getMode(heightSpec) == MeasureSpec.UNSPECIFIED ? minimumHeight : MeasureSpec.getSize(heightSpec);
        setMeasuredDimension(MeasureSpec.getSize(widthSpec), height);
    }

    protected final void setMeasuredDimension(int width, int height) {
        measuredWidth = width;
        measuredHeight = height;
    }

    public void layout(int left, int top, int right, int bottom) {
        int oldWidth = getWidth();
        int oldHeight = getHeight();
        this.left = left;
        this.top = top;
        this.right = right;
        this.bottom = bottom;
        if (oldWidth != getWidth() || oldHeight != getHeight()) {
            onSizeChanged(getWidth(), getHeight(), oldWidth, oldHeight);
        }
        onLayout(true, left, top, right, bottom);
    }

    protected void onLayout(boolean changed, int left, int top, int right, int bottom) {}

    protected void onSizeChanged(int width, int height, int oldWidth, int oldHeight) {}

    public void draw(Canvas canvas) {
        if (background != 0) {
            Paint paint = new Paint();
            paint.setColor(background);
            canvas.drawRect(0, 0, getWidth(), getHeight(), paint);
        }
        onDraw(canvas);
        dispatchDraw(canvas);
    }

    protected void onDraw(Canvas canvas) {}

    protected void dispatchDraw(Canvas canvas) {}
}
