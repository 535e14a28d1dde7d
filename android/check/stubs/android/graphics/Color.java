package android.graphics;

public class Color {
    public static final int RED = 0xffff0000;
    public static final int WHITE = 0xffffffff;

    public static int rgb(int red, int green, int blue) {
        return 0xff000000 | red << 16 | green << 8 | blue;
    }
}
