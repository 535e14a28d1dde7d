package android.content.res;

import java.io.File;
import java.io.FileInputStream;
import java.io.FileNotFoundException;
import java.io.IOException;
import java.io.InputStream;
import java.io.RandomAccessFile;

public final class AssetManager {
    private final File place;
    private final long offset;
    private final long length;

    /** A folder of assets; or a file (offset not below 0), an "APK" in which every asset lies at the same place. */
    AssetManager(File place, long offset, long length) {
        this.place = place;
        this.offset = offset;
        this.length = length;
    }

    /** Linux: the descriptor's number is found in /proc, since plain Java does not tell it. */
    public AssetFileDescriptor openFd(String name) throws IOException {
        File apk = offset < 0 ? new File(place, name) : place;
        RandomAccessFile file = new RandomAccessFile(apk, "r");
        File[] open = new File("/proc/self/fd").listFiles();
        if (open != null) {
            for (File fd : open) {
                if (fd.getCanonicalFile().equals(apk.getCanonicalFile())) {
                    return new AssetFileDescriptor(file, Integer.parseInt(fd.getName()), Math.max(0, offset), offset < 0 ? apk.length() : length);
                }
            }
        }
        file.close();
        throw new FileNotFoundException(name);
    }

    public InputStream open(String name) throws IOException {
        return new FileInputStream(new File(place, name));
    }
}
