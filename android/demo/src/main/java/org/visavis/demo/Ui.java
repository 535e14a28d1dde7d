package org.visavis.demo;

import android.content.Context;
import android.graphics.Color;
import android.graphics.Typeface;
import android.view.View;
import android.view.ViewGroup;
import android.widget.Button;
import android.widget.LinearLayout;
import android.widget.ProgressBar;
import android.widget.TextView;

/** The look of all screens. */
final class Ui {
    static final int BACKGROUND = Color.rgb(20, 22, 28);
    static final int PANEL = Color.rgb(31, 34, 43);
    static final int TEXT = Color.rgb(232, 234, 240);
    static final int DIM = Color.rgb(164, 170, 184);
    static final int GOOD = Color.rgb(96, 205, 140);
    static final int BAD = Color.rgb(240, 110, 100);
    static final int USER = Color.rgb(186, 120, 226);

    private static final int FILL = ViewGroup.LayoutParams.MATCH_PARENT;
    private static final int WRAP = ViewGroup.LayoutParams.WRAP_CONTENT;

    private Ui() {}

    static int dp(Context context, float size) {
        return Math.round(size * context.getResources().getDisplayMetrics().density);
    }

    static LinearLayout column(Context context, int padding) {
        LinearLayout column = new LinearLayout(context);
        column.setOrientation(LinearLayout.VERTICAL);
        int pixels = dp(context, padding);
        column.setPadding(pixels, pixels, pixels, pixels);
        return column;
    }

    static TextView text(LinearLayout column, float size, int color) {
        TextView text = new TextView(column.getContext());
        text.setTextSize(size);
        text.setTextColor(color);
        column.addView(text, across(column, 4));
        return text;
    }

    static TextView code(LinearLayout column, float size) {
        TextView text = text(column, size, TEXT);
        text.setTypeface(Typeface.MONOSPACE);
        return text;
    }

    static Button button(LinearLayout column, CharSequence label, View.OnClickListener action) {
        Button button = new Button(column.getContext());
        button.setAllCaps(false);
        button.setText(label);
        button.setMinHeight(dp(column.getContext(), 48)); // what a ray or a finger hits
        button.setOnClickListener(action);
        column.addView(button, across(column, 2));
        return button;
    }

    /** A bar from 0 to 1000. */
    static ProgressBar bar(LinearLayout column) {
        ProgressBar bar = new ProgressBar(column.getContext(), null, android.R.attr.progressBarStyleHorizontal);
        bar.setMax(1000);
        column.addView(bar, across(column, 8));
        return bar;
    }

    /** As wide as the column, or an equal share of a row. */
    static LinearLayout.LayoutParams across(LinearLayout group, int margin) {
        boolean row = group.getOrientation() == LinearLayout.HORIZONTAL;
        LinearLayout.LayoutParams place = new LinearLayout.LayoutParams(row ? 0 : FILL, WRAP, row ? 1 : 0);
        int pixels = dp(group.getContext(), margin);
        place.setMargins(row ? pixels : 0, pixels, row ? pixels : 0, pixels);
        return place;
    }

    /** What does not change is not laid out again. */
    static void show(TextView view, String text) {
        if (!text.contentEquals(view.getText())) {
            view.setText(text);
        }
        view.setVisibility(text.isEmpty() ? View.GONE : View.VISIBLE);
    }
}
