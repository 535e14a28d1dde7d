package org.visavis.demo;

import android.content.Context;
import android.util.TypedValue;
import android.view.View;
import android.widget.LinearLayout;
import android.widget.ProgressBar;
import android.widget.ScrollView;
import android.widget.TextView;

/** A measurement that is under way or has ended: a bar, the blocks' times, the report. */
final class MeasureScreen implements Screen {
    /** Columns of the report's widest table, in its own letters' widths. */
    private static final int COLUMNS = 76;
    /** Width of a monospaced letter over its size. */
    private static final float LETTER = 0.61f;

    private final Measurement measurement;
    private final LinearLayout column;
    private final ProgressBar bar;
    private final TextView doing;
    private final BarsView bars;
    private final TextView report;
    private final String header;

    MeasureScreen(Context context, Measurement measurement, String header, View.OnClickListener share, View.OnClickListener back) {
        this.measurement = measurement;
        this.header = header;
        column = Ui.column(context, 16);
        doing = Ui.text(column, 18, Ui.TEXT);
        bar = Ui.bar(column);
        bars = new BarsView(context, measurement.times());
        column.addView(bars, new LinearLayout.LayoutParams(LinearLayout.LayoutParams.MATCH_PARENT, Ui.dp(context, 48)));
        ScrollView scroll = new ScrollView(context);
        LinearLayout inner = Ui.column(context, 0);
        report = Ui.code(inner, 12);
        scroll.addView(inner);
        column.addView(scroll, new LinearLayout.LayoutParams(LinearLayout.LayoutParams.MATCH_PARENT, 0, 1));
        LinearLayout row = new LinearLayout(context);
        Ui.button(row, context.getString(R.string.back), back);
        Ui.button(row, context.getString(R.string.share), share);
        column.addView(row, Ui.across(column, 0));
        refresh(System.nanoTime());
    }

    /** The report as text to share. */
    String text() {
        return header + "\n\n" + measurement.report();
    }

    @Override
    public View view() {
        return column;
    }

    @Override
    public void shown(boolean now) {}

    @Override
    public void refresh(long now) {
        boolean under = !measurement.doing().isEmpty();
        doing.setText(under ? measurement.doing() : "Measured");
        bar.setProgress(Math.round(1000 * measurement.fraction()));
        float fits = report.getWidth() / (COLUMNS * LETTER);
        float most = TypedValue.applyDimension(TypedValue.COMPLEX_UNIT_SP, 15, report.getResources().getDisplayMetrics());
        if (fits > 1) {
            report.setTextSize(TypedValue.COMPLEX_UNIT_PX, Math.min(fits, most));
        }
        Ui.show(report, text());
        bars.invalidate();
        column.setKeepScreenOn(under);
    }
}
