package android.os;

public class ParcelFileDescriptor {
    private final int fd;

    ParcelFileDescriptor(int fd) {
        this.fd = fd;
    }

    public int getFd() {
        return fd;
    }
}
