package android.media;

/** The sound output of the tests: its latency, its faults, and what is truly heard. */
public final class StandInSound {
    public static final AudioManager MANAGER = new AudioManager();
    /** Whether the app may have the focus. */
    public static volatile boolean focus = true;
    /** From the buffer to the ear. */
    public static volatile double latency = 0.12;
    /** Time stamps come only so long after a start. */
    public static volatile double firstStamp = 0.15;
    /** Time stamps are off by up to this. */
    public static volatile double jitter = 0.004;
    /** Whether time stamps are to be had at all. */
    public static volatile boolean stamps = true;
    /** Whether there is an output. */
    public static volatile boolean there = true;
    static volatile AudioTrack playing;

    private StandInSound() {}

    public static boolean hasFocus() {
        return MANAGER.holder != null;
    }

    public static void changeFocus(int change) {
        if (MANAGER.holder != null) {
            MANAGER.holder.onAudioFocusChange(change);
        }
    }

    /** Whether a track plays. */
    public static boolean plays() {
        AudioTrack track = playing;
        return track != null && track.plays();
    }

    public static float volume() {
        return playing == null ? 0 : playing.volume;
    }

    /** Samples of the newest track that have reached the ear. */
    public static double heardSamples() {
        AudioTrack track = playing;
        return track == null ? 0 : track.heard(System.nanoTime());
    }

    /** The value that was written as this sample. */
    public static float sample(long index) {
        return playing.written(index);
    }

    /** The output goes away: the next write fails. */
    public static void unplug() {
        playing.dead = true;
    }
}
