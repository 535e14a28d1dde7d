package android.graphics;

import java.awt.BasicStroke;
import java.awt.Font;
import java.awt.Graphics2D;
import java.awt.font.FontRenderContext;

public class Paint {
    public static final int ANTI_ALIAS_FLAG = 1;
    private static final FontRenderContext FONTS = new FontRenderContext(null, true, true);

    int color = 0xff000000;
    float width;
    float size = 12;
    Cap cap = Cap.BUTT;
    boolean code;

    public enum Cap {
        BUTT,
        ROUND,
        SQUARE
    }

    public Paint() {}

    public Paint(int flags) {}

    public void setColor(int color) {
        this.color = color;
    }

    public void setStrokeWidth(float width) {
        this.width = width;
    }

    public void setStrokeCap(Cap cap) {
        this.cap = cap;
    }

    public void setTextSize(float size) {
        this.size = size;
    }

    public Typeface setTypeface(Typeface face) {
        code = face == Typeface.MONOSPACE;
        return face;
    }

    public float measureText(String text) {
        return (float) font().getStringBounds(text, FONTS).getWidth();
    }

    Font font() {
        return new Font(code ? Font.MONOSPACED : Font.SANS_SERIF, Font.PLAIN, 1).deriveFont(size);
    }

    void on(Graphics2D graphics) {
        graphics.setColor(new java.awt.Color(color, true));
        graphics.setFont(font());
        int end = cap == Cap.ROUND ? BasicStroke.CAP_ROUND : cap == Cap.SQUARE ? BasicStroke.CAP_SQUARE : BasicStroke.CAP_BUTT;
        graphics.setStroke(new BasicStroke(Math.max(1, width), end, BasicStroke.JOIN_MITER));
    }
}
