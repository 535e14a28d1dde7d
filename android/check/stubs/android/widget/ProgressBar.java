package android.widget;

import android.content.Context;
import android.graphics.Canvas;
import android.graphics.Paint;
import android.util.AttributeSet;
import android.view.View;

public class ProgressBar extends View {
    int max = 100;
    int progress;

    public ProgressBar(Context context, AttributeSet attributes, int style) {
        super(context);
        setMinimumHeight(Math.round(16 * getResources().getDisplayMetrics().density));
    }

    public void setMax(int max) {
        this.max = max;
    }

    public void setProgress(int progress) {
        this.progress = progress;
    }

    public int getProgress() {
        return progress;
    }

    @Override
    protected void onMeasure(int widthSpec, int heightSpec) {
        boolean exact = MeasureSpec.getMode(heightSpec) == MeasureSpec.EXACTLY;
        setMeasuredDimension(MeasureSpec.getSize(widthSpec), exact ? MeasureSpec.getSize(heightSpec) : getMinimumHeight());
    }

    @Override
    protected void onDraw(Canvas canvas) {
        Paint paint = new Paint();
        float middle = getHeight() / 2f;
        float half = getMinimumHeight() / 8f;
        paint.setColor(0xff505664);
        canvas.drawRect(0, middle - half, getWidth(), middle + half, paint);
        paint.setColor(0xff80cbc4);
        canvas.drawRect(0, middle - half, getWidth() * (progress / (float) max), middle + half, paint);
    }
}
