package org.visavis;

import androidx.annotation.NonNull;

/** Options of a session: start from {@code new SessionOptions()} and change what is needed. Values are checked when the session is made. */
public final class SessionOptions {
    long seed;
    int threads = 1;
    long coreMask;
    Sampler sampler = Sampler.MIDPOINT4;
    float gaze = Float.NaN;
    float guidance = Float.NaN;
    float gazeGuidance = Float.NaN;
    float temperature = Float.NaN;
    double startX;
    double startZ;
    double startYaw;
    boolean stance = true;
    boolean guard = true;
    float budget;
    double voiceAhead = 60;
    float sensitivity;

    /** Same seed and same inputs: same motion, bit for bit. Default 0. */
    @NonNull
    public SessionOptions seed(long seed) {
        this.seed = seed;
        return this;
    }

    /** Threads that compute a block: 1 (default), the one that polls, or 2. The motion is the same. */
    @NonNull
    public SessionOptions threads(int threads) {
        this.threads = threads;
        return this;
    }

    /** Cores that the second thread may run on, bit i for core i; 0 (default): any. See {@link Visavis#pinCurrentThread} for the first. */
    @NonNull
    public SessionOptions coreMask(long coreMask) {
        this.coreMask = coreMask;
        return this;
    }

    /** Sampler at the start; {@link Sampler#MIDPOINT4} by default. */
    @NonNull
    public SessionOptions sampler(@NonNull Sampler sampler) {
        this.sampler = sampler;
        return this;
    }

    /** Gaze target, -1 to 1 (0 is averted, 1 sustained eye contact); what comes naturally by default. */
    @NonNull
    public SessionOptions gaze(float target) {
        this.gaze = checked("gaze target", target);
        return this;
    }

    /** Guidance weights, 0 to 20: of the conditioning as a whole (1 is none), and of the gaze target; the bundle's by default. */
    @NonNull
    public SessionOptions guidance(float weight, float gaze) {
        this.guidance = checked("guidance weight", weight);
        this.gazeGuidance = checked("gaze guidance weight", gaze);
        return this;
    }

    /** Scale of the noise, 0 to 2; less is calmer. The bundle's by default. */
    @NonNull
    public SessionOptions temperature(float temperature) {
        this.temperature = checked("temperature", temperature);
        return this;
    }

    /** Where the agent stands at the start: metres, and the heading in radians (0 faces +Z, positive turns towards +X). */
    @NonNull
    public SessionOptions start(double x, double z, double yaw) {
        startX = x;
        startZ = z;
        startYaw = yaw;
        return this;
    }

    /** Whether planted feet are kept in place; true by default. */
    @NonNull
    public SessionOptions stance(boolean stance) {
        this.stance = stance;
        return this;
    }

    /** Whether frames that no body could show are replaced by a held pose; true by default. */
    @NonNull
    public SessionOptions guard(boolean guard) {
        this.guard = guard;
        return this;
    }

    /**
     * Milliseconds that a block may take, 1 to 133.3: a governor then chooses the sampler of each block, the session's at best, so that none
     * comes late. 0 (default): the session's sampler, always.
     */
    @NonNull
    public SessionOptions budget(float milliseconds) {
        this.budget = checked("budget", milliseconds);
        return this;
    }

    /**
     * Seconds of sound that each voice may be ahead of the block that was computed last, 0.5 to 60 (default); what is more is dropped and counted. A
     * second takes 192 KB: a crowd that hears sound as it comes does with the least.
     */
    @NonNull
    public SessionOptions voiceAhead(double seconds) {
        voiceAhead = seconds;
        return this;
    }

    /** How much the agent minds sounds in the room: -1 dull, 0 (default) neutral, 1 sensitive, numbers between and up to 1.5 either way. */
    @NonNull
    public SessionOptions sensitivity(float sensitivity) {
        this.sensitivity = sensitivity;
        return this;
    }

    /** NaN stands for the bundle's own value inside. */
    private static float checked(String name, float value) {
        if (Float.isNaN(value)) {
            throw new IllegalArgumentException(name + " is not a number");
        }
        return value;
    }
}
