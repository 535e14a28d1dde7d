package android.util;

public final class Log {
    private Log() {}

    public static int i(String tag, String text) {
        System.out.println("I/" + tag + ": " + text);
        return 0;
    }

    public static int e(String tag, String text) {
        System.out.println("E/" + tag + ": " + text);
        return 0;
    }
}
