package android.os;

public class ParcelFileDescriptor {
    private final int fd;

    public ParcelFileDescriptor(int fd) {
        this.fd = fd;
    }

    public int getFd() {
        return fd;
    }
}
