package org.visavis.demo;

import android.content.Context;
import android.view.View;
import android.widget.LinearLayout;
import android.widget.ScrollView;

/** What failed, what to do about it, and the error's own words to share. */
final class FailureScreen implements Screen {
    private final ScrollView scroll;

    FailureScreen(Context context, Failure failure, View.OnClickListener again, View.OnClickListener share) {
        scroll = new ScrollView(context);
        LinearLayout column = Ui.column(context, 24);
        Ui.text(column, 22, Ui.BAD).setText(failure.what);
        Ui.text(column, 16, Ui.TEXT).setText(failure.todo);
        LinearLayout row = new LinearLayout(context);
        Ui.button(row, context.getString(R.string.try_again), again);
        Ui.button(row, context.getString(R.string.share), share);
        column.addView(row, Ui.across(column, 8));
        Ui.code(column, 12).setText(failure.details);
        scroll.addView(column);
    }

    @Override
    public View view() {
        return scroll;
    }

    @Override
    public void shown(boolean now) {}

    @Override
    public void refresh(long now) {}
}
