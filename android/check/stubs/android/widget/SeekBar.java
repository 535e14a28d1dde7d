package android.widget;

import android.content.Context;
import android.view.View;

public class SeekBar extends View {
    public interface OnSeekBarChangeListener {
        void onProgressChanged(SeekBar bar, int progress, boolean fromUser);

        void onStartTrackingTouch(SeekBar bar);

        void onStopTrackingTouch(SeekBar bar);
    }

    public SeekBar(Context context) {
        super(context);
    }

    public void setMax(int max) {}

    public void setProgress(int progress) {}

    public void setOnSeekBarChangeListener(OnSeekBarChangeListener listener) {}
}
