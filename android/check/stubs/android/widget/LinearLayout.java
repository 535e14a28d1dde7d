package android.widget;

import android.content.Context;
import android.view.Gravity;
import android.view.View;
import android.view.ViewGroup;

public class LinearLayout extends ViewGroup {
    public static final int HORIZONTAL = 0;
    public static final int VERTICAL = 1;

    private int orientation;
    private int gravity;

    public static class LayoutParams extends ViewGroup.MarginLayoutParams {
        public float weight;

        public LayoutParams(int width, int height) {
            super(width, height);
        }

        public LayoutParams(int width, int height, float weight) {
            super(width, height);
            this.weight = weight;
        }
    }

    public LinearLayout(Context context) {
        super(context);
    }

    public void setOrientation(int orientation) {
        this.orientation = orientation;
    }

    public int getOrientation() {
        return orientation;
    }

    public void setGravity(int gravity) {
        this.gravity = gravity;
    }

    private static LayoutParams place(View child) {
        return (LayoutParams) child.getLayoutParams();
    }

    /** Length along the orientation, margins included, of all children but those with a weight. */
    @Override
    protected void onMeasure(int widthSpec, int heightSpec) {
        boolean row = orientation == HORIZONTAL;
        int width = MeasureSpec.getSize(widthSpec) - getPaddingLeft() - getPaddingRight();
        boolean free = MeasureSpec.getMode(heightSpec) == MeasureSpec.UNSPECIFIED;
        int height = free ? 0 : MeasureSpec.getSize(heightSpec) - getPaddingTop() - getPaddingBottom();
        float weights = 0;
        int used = 0;
        int across = 0;
        for (int pass = 0; pass < 2; pass++) {
            for (int i = 0; i < getChildCount(); i++) {
                View child = getChildAt(i);
                LayoutParams place = place(child);
                if (child.getVisibility() == GONE || (pass == 1) != (place.weight > 0)) {
                    weights += child.getVisibility() != GONE && pass == 0 ? place.weight : 0;
                    continue;
                }
                int sides = place.leftMargin + place.rightMargin;
                int ends = place.topMargin + place.bottomMargin;
                if (row) {
                    int share = place.weight > 0 ? Math.round((width - used) * place.weight / weights) - sides : width - used - sides;
                    child.measure(exactly(share), MeasureSpec.makeMeasureSpec(height, free ? MeasureSpec.UNSPECIFIED : MeasureSpec.AT_MOST));
                    across = Math.max(across, child.getMeasuredHeight() + ends);
                    used += place.weight > 0 ? 0 : share + sides;
                } else {
                    int spec = MeasureSpec.makeMeasureSpec(Math.max(0, height - used - ends), free ? MeasureSpec.UNSPECIFIED : MeasureSpec.AT_MOST);
                    if (place.weight > 0) {
                        spec = exactly(Math.round((height - used) * place.weight / weights) - ends);
                    } else if (place.height >= 0) {
                        spec = exactly(place.height);
                    }
                    child.measure(exactly(width - sides), spec);
                    used += place.weight > 0 ? 0 : child.getMeasuredHeight() + ends;
                }
            }
            across = row ? across : used;
        }
        int tall = across + getPaddingTop() + getPaddingBottom();
        boolean exact = MeasureSpec.getMode(heightSpec) == MeasureSpec.EXACTLY;
        setMeasuredDimension(MeasureSpec.getSize(widthSpec), exact ? MeasureSpec.getSize(heightSpec) : tall);
    }

    private static int exactly(int size) {
        return MeasureSpec.makeMeasureSpec(Math.max(0, size), MeasureSpec.EXACTLY);
    }

    @Override
    protected void onLayout(boolean changed, int left, int top, int right, int bottom) {
        boolean row = orientation == HORIZONTAL;
        int sum = 0;
        for (int i = 0; i < getChildCount(); i++) {
            View child = getChildAt(i);
            LayoutParams place = place(child);
            sum += row || child.getVisibility() == GONE ? 0 : child.getMeasuredHeight() + place.topMargin + place.bottomMargin;
        }
        int free = bottom - top - getPaddingTop() - getPaddingBottom() - sum;
        int y = getPaddingTop() + (gravity == Gravity.CENTER_VERTICAL && !row ? Math.max(0, free / 2) : 0);
        int x = getPaddingLeft();
        for (int i = 0; i < getChildCount(); i++) {
            View child = getChildAt(i);
            LayoutParams place = place(child);
            if (child.getVisibility() == GONE) {
                continue;
            }
            int atX = x + place.leftMargin;
            int atY = y + place.topMargin;
            child.layout(atX, atY, atX + child.getMeasuredWidth(), atY + child.getMeasuredHeight());
            x += row ? child.getMeasuredWidth() + place.leftMargin + place.rightMargin : 0;
            y += row ? 0 : child.getMeasuredHeight() + place.topMargin + place.bottomMargin;
        }
    }
}
