package org.visavis.demo;

import android.content.Context;
import android.view.Gravity;
import android.view.View;
import android.widget.LinearLayout;
import android.widget.ProgressBar;
import android.widget.TextView;

/** A bar, and what is being loaded. */
final class LoadingScreen implements Screen {
    private final Loading loading;
    private final LinearLayout column;
    private final ProgressBar bar;
    private final TextView step;

    LoadingScreen(Context context, Loading loading) {
        this.loading = loading;
        column = Ui.column(context, 32);
        column.setGravity(Gravity.CENTER_VERTICAL);
        Ui.text(column, 24, Ui.TEXT).setText(R.string.app_name);
        Ui.text(column, 16, Ui.DIM).setText(R.string.loading);
        bar = Ui.bar(column);
        step = Ui.text(column, 14, Ui.DIM);
    }

    @Override
    public View view() {
        return column;
    }

    @Override
    public void shown(boolean now) {}

    @Override
    public void refresh(long now) {
        bar.setProgress(Math.round(1000 * loading.fraction()));
        Ui.show(step, loading.step());
    }
}
