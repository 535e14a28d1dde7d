package android.os;

/** Makes what only the platform can make. */
public final class StandInServices {
    private StandInServices() {}

    public static ParcelFileDescriptor descriptor(int fd) {
        return new ParcelFileDescriptor(fd);
    }

    public static PowerManager power() {
        return new PowerManager();
    }
}
