package android.content.res;

import java.io.File;
import java.io.FileNotFoundException;
import java.io.IOException;
import java.io.InputStream;
import java.io.RandomAccessFile;

/** Stands for Android's: one "APK" in which every asset lies at the same place. */
public class AssetManager {
    private final File apk;
    private final long offset;
    private final long length;

    public AssetManager(File apk, long offset, long length) {
        this.apk = apk;
        this.offset = offset;
        this.length = length;
    }

    /** Linux: the descriptor's number is found in /proc, since plain Java does not tell it. */
    public AssetFileDescriptor openFd(String name) throws IOException {
        RandomAccessFile file = new RandomAccessFile(apk, "r");
        File[] open = new File("/proc/self/fd").listFiles();
        if (open != null) {
            for (File fd : open) {
                if (fd.getCanonicalFile().equals(apk.getCanonicalFile())) {
                    return new AssetFileDescriptor(file, Integer.parseInt(fd.getName()), offset, length);
                }
            }
        }
        file.close();
        throw new FileNotFoundException(name);
    }

    public InputStream open(String name) throws IOException {
        throw new FileNotFoundException(name);
    }
}
