package android.graphics;

import android.view.StandInWindow;
import android.view.View;
import java.awt.image.BufferedImage;

/** A view as a picture. */
public final class StandInPicture {
    private StandInPicture() {}

    /** Pixels into a canvas, at its origin. */
    public static void put(Canvas canvas, int width, int height, int[] pixels) {
        BufferedImage image = new BufferedImage(width, height, BufferedImage.TYPE_INT_RGB);
        image.setRGB(0, 0, width, height, pixels, 0, width);
        canvas.image(image);
    }

    public static BufferedImage of(View view, int width, int height) {
        StandInWindow.lay(view, width, height);
        BufferedImage image = new BufferedImage(width, height, BufferedImage.TYPE_INT_RGB);
        view.draw(new Canvas(image.createGraphics(), width, height));
        return image;
    }
}
