package android.widget;

import android.content.Context;
import android.graphics.Canvas;
import android.graphics.Paint;

public class SeekBar extends AbsSeekBar {
    private OnSeekBarChangeListener listener;

    public interface OnSeekBarChangeListener {
        void onProgressChanged(SeekBar bar, int progress, boolean fromUser);

        void onStartTrackingTouch(SeekBar bar);

        void onStopTrackingTouch(SeekBar bar);
    }

    public SeekBar(Context context) {
        super(context, null, 0);
        setMinimumHeight(Math.round(28 * getResources().getDisplayMetrics().density));
    }

    public void setOnSeekBarChangeListener(OnSeekBarChangeListener listener) {
        this.listener = listener;
    }

    @Override
    public void setProgress(int progress) {
        super.setProgress(progress);
        if (listener != null) {
            listener.onProgressChanged(this, progress, false);
        }
    }

    @Override
    protected void onDraw(Canvas canvas) {
        super.onDraw(canvas);
        Paint paint = new Paint();
        paint.setColor(0xff80cbc4);
        float radius = getMinimumHeight() / 4f;
        canvas.drawCircle(radius + (getWidth() - 2 * radius) * progress / max, getHeight() / 2f, radius, paint);
    }
}
