package android.widget;

import android.content.Context;
import android.graphics.Canvas;
import android.graphics.Paint;
import android.graphics.Typeface;
import android.util.TypedValue;
import android.view.View;
import java.util.ArrayList;
import java.util.List;

public class TextView extends View {
    private final Paint paint = new Paint();
    private CharSequence text = "";
    private float size;
    private int minHeight;
    boolean centred;

    public TextView(Context context) {
        super(context);
        setTextSize(14);
        paint.setColor(0xffe0e0e0);
    }

    public final void setText(CharSequence text) {
        this.text = text;
    }

    public final void setText(int id) {
        setText(getContext().getString(id));
    }

    public CharSequence getText() {
        return text;
    }

    public void setTextSize(float size) {
        setTextSize(TypedValue.COMPLEX_UNIT_SP, size);
    }

    public void setTextSize(int unit, float size) {
        this.size = TypedValue.applyDimension(unit, size, getResources().getDisplayMetrics());
        paint.setTextSize(this.size);
    }

    public void setTextColor(int color) {
        paint.setColor(color);
    }

    public void setTypeface(Typeface face) {
        paint.setTypeface(face);
    }

    public void setAllCaps(boolean caps) {}

    public void setMinHeight(int pixels) {
        minHeight = pixels;
    }

    private List<String> lines(int width) {
        List<String> lines = new ArrayList<>();
        for (String paragraph : text.toString().split("\n", -1)) {
            String line = "";
            for (String word : paragraph.split("(?<= )")) {
                if (!line.isEmpty() && paint.measureText((line + word).stripTrailing()) > width) {
                    lines.add(line);
                    line = "";
                }
                line += word;
            }
            lines.add(line);
        }
        return lines;
    }

    private float lineHeight() {
        return 1.25f * size;
    }

    @Override
    protected void onMeasure(int widthSpec, int heightSpec) {
        int width = MeasureSpec.getSize(widthSpec);
        int sides = getPaddingTop() + getPaddingBottom();
        int height = Math.max(minHeight, Math.round(lines(width).size() * lineHeight()) + sides);
        setMeasuredDimension(width, MeasureSpec.getMode(heightSpec) == MeasureSpec.EXACTLY ? MeasureSpec.getSize(heightSpec) : height);
    }

    @Override
    protected void onDraw(Canvas canvas) {
        List<String> lines = lines(getWidth());
        float y = centred ? (getHeight() - lines.size() * lineHeight()) / 2 : 0;
        for (String line : lines) {
            y += lineHeight();
            float x = centred ? (getWidth() - paint.measureText(line)) / 2 : 0;
            canvas.drawText(line, x, y - 0.3f * size, paint);
        }
    }
}
