package android.widget;

import android.content.Context;
import android.graphics.Canvas;
import android.graphics.Paint;

public class Button extends TextView {
    public Button(Context context) {
        super(context);
        centred = true;
        setTextColor(0xffffffff);
    }

    @Override
    public void draw(Canvas canvas) {
        Paint paint = new Paint();
        paint.setColor(0xff4a4f5c);
        canvas.drawRect(2, 4, getWidth() - 2, getHeight() - 4, paint);
        super.draw(canvas);
    }
}
