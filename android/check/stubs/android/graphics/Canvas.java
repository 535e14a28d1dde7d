package android.graphics;

public class Canvas {
    public void drawColor(int color) {}

    public void drawLine(float x0, float y0, float x1, float y1, Paint paint) {}

    public void drawCircle(float x, float y, float radius, Paint paint) {}

    public void drawText(String text, float x, float y, Paint paint) {}
}
