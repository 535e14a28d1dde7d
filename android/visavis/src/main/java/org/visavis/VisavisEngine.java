package org.visavis;

import android.content.res.AssetFileDescriptor;
import android.content.res.AssetManager;
import androidx.annotation.NonNull;
import java.io.File;
import java.io.IOException;
import java.nio.ByteBuffer;

/** A loaded bundle: immutable, shared by any number of sessions on any threads. Close it when no more sessions are to be made. */
public final class VisavisEngine implements AutoCloseable {
    private final long handle;
    private final Skeleton skeleton;

    private VisavisEngine(long handle) {
        this.handle = handle;
        this.skeleton = new Skeleton(Native.engineJointNames(handle), Native.engineJointParents(handle), Native.engineRestOffsets(handle));
    }

    /**
     * Loads a bundle from the app's assets, where it lies in the APK. The asset must be stored uncompressed:
     * {@code androidResources { noCompress += "safetensors" }}.
     *
     * @throws IOException when there is no such asset, or it is compressed
     * @throws BundleException when it is not a bundle that this library can use
     */
    @NonNull
    public static VisavisEngine fromAsset(@NonNull AssetManager assets, @NonNull String name) throws IOException {
        try (AssetFileDescriptor asset = assets.openFd(name)) {
            int fd = asset.getParcelFileDescriptor().getFd();
            return new VisavisEngine(Native.engineFromFd(fd, asset.getStartOffset(), asset.getLength()));
        }
    }

    /**
     * Loads a bundle from a file.
     *
     * @throws IOException when it cannot be read
     * @throws BundleException when it is not a bundle that this library can use
     */
    @NonNull
    public static VisavisEngine fromFile(@NonNull File file) throws IOException {
        return new VisavisEngine(Native.engineFromPath(file.getPath()));
    }

    /**
     * Loads a bundle from memory: the bytes between position and limit of a direct buffer. They are not needed afterwards.
     *
     * @throws IllegalArgumentException when the buffer is not direct
     * @throws BundleException when it is not a bundle that this library can use
     */
    @NonNull
    public static VisavisEngine fromBytes(@NonNull ByteBuffer bytes) {
        return new VisavisEngine(Native.engineFromBuffer(bytes, bytes.position(), bytes.remaining()));
    }

    /**
     * Loads a bundle from an array, which is copied meanwhile.
     *
     * @throws BundleException when it is not a bundle that this library can use
     */
    @NonNull
    public static VisavisEngine fromBytes(@NonNull byte[] bytes) {
        return new VisavisEngine(Native.engineFromBytes(bytes));
    }

    /**
     * Starts a session; all memory that it will need is taken here.
     *
     * @throws IllegalArgumentException for an option out of range, or one that the bundle cannot do
     * @throws IllegalStateException when this engine is closed
     */
    @NonNull
    public VisavisSession newSession(@NonNull SessionOptions options) {
        long session = Native.sessionNew(handle, options.seed, options.threads, options.coreMask, options.sampler.name, options.gaze,
                options.guidance, options.gazeGuidance, options.temperature, options.startX, options.startZ, options.startYaw,
                options.stance, options.guard, options.budget, options.voiceAhead, options.sensitivity);
        return new VisavisSession(session, skeleton);
    }

    /** Starts a session with the default options. */
    @NonNull
    public VisavisSession newSession() {
        return newSession(new SessionOptions());
    }

    /** Name of the model. */
    @NonNull
    public String name() {
        return Native.engineName(handle);
    }

    /** Whether the bundle has the student that {@link Sampler#SINGLE} needs. */
    public boolean hasStudent() {
        return Native.engineHasStudent(handle);
    }

    /** Whether the bundle has hearing: sounds in the room are heard ({@link VisavisSession#pushSound}). */
    public boolean hasHearing() {
        return Native.engineHasHearing(handle);
    }

    /** The joints of its frames. */
    @NonNull
    public Skeleton skeleton() {
        return skeleton;
    }

    long handle() {
        return handle;
    }

    /** Lets go of the bundle. Sessions live on. Closing twice does nothing. */
    @Override
    public void close() {
        Native.engineClose(handle);
    }
}
