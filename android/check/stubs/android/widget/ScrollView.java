package android.widget;

import android.content.Context;
import android.view.View;

public class ScrollView extends FrameLayout {
    private boolean fills;

    public ScrollView(Context context) {
        super(context);
    }

    public void setFillViewport(boolean fills) {
        this.fills = fills;
    }

    @Override
    protected void onMeasure(int widthSpec, int heightSpec) {
        View child = getChildAt(0);
        child.measure(widthSpec, MeasureSpec.makeMeasureSpec(0, MeasureSpec.UNSPECIFIED));
        int height = MeasureSpec.getSize(heightSpec);
        if (fills && child.getMeasuredHeight() < height && MeasureSpec.getMode(heightSpec) == MeasureSpec.EXACTLY) {
            child.measure(widthSpec, heightSpec);
        }
        boolean exact = MeasureSpec.getMode(heightSpec) == MeasureSpec.EXACTLY;
        setMeasuredDimension(MeasureSpec.getSize(widthSpec), exact ? height : Math.min(height, child.getMeasuredHeight()));
    }
}
