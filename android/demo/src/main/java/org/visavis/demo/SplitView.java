package org.visavis.demo;

import android.content.Context;
import android.view.View;
import android.view.ViewGroup;

/** The stage and its controls: beside each other in a wide window, one above the other in a tall one. */
final class SplitView extends ViewGroup {
    private static final int PANEL_DP = 320;

    private final View stage;
    private final View panel;

    SplitView(Context context, View stage, View panel) {
        super(context);
        this.stage = stage;
        this.panel = panel;
        addView(stage);
        addView(panel);
    }

    @Override
    protected void onMeasure(int widthSpec, int heightSpec) {
        int width = MeasureSpec.getSize(widthSpec);
        int height = MeasureSpec.getSize(heightSpec);
        setMeasuredDimension(width, height);
        if (width > height) {
            int controls = Math.min(Ui.dp(getContext(), PANEL_DP), width / 2);
            panel.measure(RootView.exactly(controls), RootView.exactly(height));
            stage.measure(RootView.exactly(width - controls), RootView.exactly(height));
        } else {
            panel.measure(RootView.exactly(width), MeasureSpec.makeMeasureSpec(height / 2, MeasureSpec.AT_MOST));
            stage.measure(RootView.exactly(width), RootView.exactly(height - panel.getMeasuredHeight()));
        }
    }

    @Override
    protected void onLayout(boolean changed, int left, int top, int right, int bottom) {
        int width = right - left;
        int height = bottom - top;
        stage.layout(0, 0, stage.getMeasuredWidth(), stage.getMeasuredHeight());
        panel.layout(width - panel.getMeasuredWidth(), height - panel.getMeasuredHeight(), width, height);
    }
}
