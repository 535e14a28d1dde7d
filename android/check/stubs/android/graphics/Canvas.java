package android.graphics;

import java.awt.AlphaComposite;
import java.awt.Graphics2D;
import java.awt.RenderingHints;
import java.awt.Shape;
import java.awt.geom.AffineTransform;
import java.awt.geom.Ellipse2D;
import java.awt.geom.Line2D;
import java.awt.geom.Rectangle2D;
import java.util.ArrayDeque;
import java.util.Deque;

/** Draws on a Java2D image. */
public class Canvas {
    private final Graphics2D graphics;
    private final Deque<AffineTransform> places = new ArrayDeque<>();
    private final Deque<Shape> clips = new ArrayDeque<>();

    Canvas(Graphics2D graphics, int width, int height) {
        this.graphics = graphics;
        graphics.setClip(0, 0, width, height);
        graphics.setComposite(AlphaComposite.SrcOver);
        graphics.setRenderingHint(RenderingHints.KEY_ANTIALIASING, RenderingHints.VALUE_ANTIALIAS_ON);
        graphics.setRenderingHint(RenderingHints.KEY_TEXT_ANTIALIASING, RenderingHints.VALUE_TEXT_ANTIALIAS_ON);
        graphics.setRenderingHint(RenderingHints.KEY_STROKE_CONTROL, RenderingHints.VALUE_STROKE_PURE);
    }

    public int save() {
        places.push(graphics.getTransform());
        clips.push(graphics.getClip());
        return places.size();
    }

    public void restore() {
        graphics.setTransform(places.pop());
        graphics.setClip(clips.pop());
    }

    public void translate(float x, float y) {
        graphics.translate(x, y);
    }

    public boolean clipRect(int left, int top, int right, int bottom) {
        graphics.clipRect(left, top, right - left, bottom - top);
        return true;
    }

    public void drawColor(int color) {
        graphics.setColor(new java.awt.Color(color, true));
        graphics.fill(graphics.getClip());
    }

    public void drawLine(float x0, float y0, float x1, float y1, Paint paint) {
        paint.on(graphics);
        graphics.draw(new Line2D.Float(x0, y0, x1, y1));
    }

    public void drawRect(float left, float top, float right, float bottom, Paint paint) {
        paint.on(graphics);
        graphics.fill(new Rectangle2D.Float(left, top, right - left, bottom - top));
    }

    public void drawOval(float left, float top, float right, float bottom, Paint paint) {
        paint.on(graphics);
        graphics.fill(new Ellipse2D.Float(left, top, right - left, bottom - top));
    }

    public void drawCircle(float x, float y, float radius, Paint paint) {
        drawOval(x - radius, y - radius, x + radius, y + radius, paint);
    }

    public void drawText(String text, float x, float y, Paint paint) {
        paint.on(graphics);
        graphics.drawString(text, x, y);
    }

    void image(java.awt.image.BufferedImage image) {
        graphics.drawImage(image, 0, 0, null);
    }
}
