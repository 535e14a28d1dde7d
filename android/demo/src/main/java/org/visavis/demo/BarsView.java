package org.visavis.demo;

import android.content.Context;
import android.graphics.Canvas;
import android.graphics.Paint;
import android.view.View;

/** The last blocks' times as bars; its height is the deadline. */
final class BarsView extends View {
    private final BlockTimes times;
    private final float[] copy;
    private final Paint paint = new Paint();

    BarsView(Context context, BlockTimes times) {
        super(context);
        this.times = times;
        copy = new float[times.room()];
        setBackgroundColor(Ui.BACKGROUND);
    }

    @Override
    protected void onDraw(Canvas canvas) {
        super.onDraw(canvas);
        int count = times.copy(copy);
        float step = getWidth() / (float) copy.length;
        for (int i = copy.length - count; i < copy.length; i++) {
            boolean late = copy[i] > BlockTimes.DEADLINE;
            paint.setColor(late ? Ui.BAD : Ui.GOOD);
            paint.setStrokeWidth(Math.max(1, 0.7f * step));
            float x = (i + 0.5f) * step;
            canvas.drawLine(x, getHeight(), x, getHeight() * (1 - Math.min(1, copy[i] / BlockTimes.DEADLINE)), paint);
        }
    }
}
