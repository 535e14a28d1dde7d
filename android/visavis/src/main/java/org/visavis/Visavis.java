package org.visavis;

import androidx.annotation.NonNull;

/** The library itself. */
public final class Visavis {
    private Visavis() {}

    /** Version of the native library, such as "0.1.0". */
    @NonNull
    public static String version() {
        return Native.version();
    }

    /**
     * The kernel's id of the calling thread, for {@code PerformanceHintManager.createHintSession}: the thread that polls, together
     * with {@link VisavisSession#workerThreadIds()}.
     */
    public static int currentThreadId() {
        return Native.currentThreadId();
    }

    /**
     * Lets the calling thread run only on some cores.
     *
     * @param coreMask bit i stands for core i
     * @throws IllegalArgumentException for a mask without any core that this process may use
     */
    public static void pinCurrentThread(long coreMask) {
        Native.pinCurrentThread(coreMask);
    }
}
