package android.content.res;

import android.os.ParcelFileDescriptor;
import android.os.StandInServices;
import java.io.Closeable;
import java.io.FileInputStream;
import java.io.IOException;
import java.io.RandomAccessFile;

public class AssetFileDescriptor implements Closeable {
    private final RandomAccessFile file;
    private final int fd;
    private final long offset;
    private final long length;

    AssetFileDescriptor(RandomAccessFile file, int fd, long offset, long length) {
        this.file = file;
        this.fd = fd;
        this.offset = offset;
        this.length = length;
    }

    public ParcelFileDescriptor getParcelFileDescriptor() {
        return StandInServices.descriptor(fd);
    }

    public long getStartOffset() {
        return offset;
    }

    public long getLength() {
        return length;
    }

    public FileInputStream createInputStream() throws IOException {
        FileInputStream in = new FileInputStream(file.getFD()) {
            private long left = length;

            @Override
            public int read() throws IOException {
                return left-- > 0 ? super.read() : -1;
            }

            @Override
            public int read(byte[] into, int from, int count) throws IOException {
                try {
                    Thread.sleep(StandInAssets.delay);
                } catch (InterruptedException e) {
                    throw new IOException(e);
                }
                int got = left <= 0 ? -1 : super.read(into, from, (int) Math.min(count, left));
                left -= Math.max(0, got);
                return got;
            }
        };
        file.seek(offset);
        return in;
    }

    @Override
    public void close() throws IOException {
        file.close();
    }
}
