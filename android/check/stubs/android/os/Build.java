package android.os;

public class Build {
    public static final String MANUFACTURER = System.getProperty("os.name");
    public static final String MODEL = System.getProperty("os.arch");

    public static class VERSION {
        public static final String RELEASE = System.getProperty("os.version");
        public static final int SDK_INT = Integer.getInteger("visavis.sdk", 29);
    }
}
