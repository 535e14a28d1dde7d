package android.view;

import android.content.Context;
import android.graphics.Canvas;

public class View {
    public interface OnClickListener {
        void onClick(View view);
    }

    public View(Context context) {}

    public final int getWidth() {
        return 0;
    }

    public final int getHeight() {
        return 0;
    }

    public boolean onTouchEvent(MotionEvent event) {
        return false;
    }

    protected void onDraw(Canvas canvas) {}

    public void postInvalidateOnAnimation() {}

    public void setOnClickListener(OnClickListener listener) {}
}
