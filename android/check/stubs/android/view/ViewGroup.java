package android.view;

import android.content.Context;

public abstract class ViewGroup extends View {
    public static class LayoutParams {}

    public ViewGroup(Context context) {
        super(context);
    }

    public void addView(View child) {}

    public void addView(View child, LayoutParams parameters) {}
}
