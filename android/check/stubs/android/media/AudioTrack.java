package android.media;

import java.util.Arrays;
import java.util.Random;

/** Plays in real time: takes samples off its buffer from when it is full, after a pause too, and loses the time in which there are none. */
public class AudioTrack {
    public static final int MODE_STREAM = 1;
    public static final int WRITE_NON_BLOCKING = 1;
    public static final int STATE_UNINITIALIZED = 0;
    public static final int STATE_INITIALIZED = 1;
    public static final int ERROR_DEAD_OBJECT = -6;

    final int rate;
    final int room;
    volatile float volume = 1;
    volatile boolean dead;
    private final Random random = new Random(5);
    private float[] samples = new float[1 << 16];
    private int count;
    private double taken;
    private long clock;
    private long started;
    private boolean playing;
    private boolean flowing;

    AudioTrack(int rate, int bytes) {
        this.rate = rate;
        room = bytes / 4;
    }

    public static int getMinBufferSize(int sampleRateInHz, int channelConfig, int audioFormat) {
        return 4 * sampleRateInHz / 25;
    }

    public int getState() {
        return StandInSound.there ? STATE_INITIALIZED : STATE_UNINITIALIZED;
    }

    public int getBufferSizeInFrames() {
        return room;
    }

    public synchronized void play() {
        run();
        playing = true;
        started = clock;
        StandInSound.playing = this;
    }

    public synchronized void pause() {
        run();
        playing = false;
        flowing = false;
    }

    public int setVolume(float gain) {
        volume = gain;
        return 0;
    }

    synchronized boolean plays() {
        return playing && !dead;
    }

    public synchronized int write(float[] audioData, int offsetInFloats, int sizeInFloats, int writeMode) {
        if (dead) {
            return ERROR_DEAD_OBJECT;
        }
        run();
        int fits = (int) Math.min(sizeInFloats, room - (count - Math.ceil(taken)));
        if (count + fits > samples.length) {
            samples = Arrays.copyOf(samples, 2 * (count + fits));
        }
        System.arraycopy(audioData, offsetInFloats, samples, count, fits);
        count += fits;
        return fits;
    }

    /** Brings the playback up to now. */
    private void run() {
        long now = System.nanoTime();
        if (playing && !flowing && count - taken >= room - 1) {
            flowing = true;
            clock = now;
        }
        if (playing && flowing) {
            taken = Math.min(count, taken + (now - clock) * 1e-9 * rate);
        }
        clock = now;
    }

    /** Samples that have reached the ear; those on the way stand still in a pause. */
    synchronized double heard(long now) {
        run();
        return Math.max(0, taken - StandInSound.latency * rate);
    }

    synchronized float written(long index) {
        return index < count ? samples[(int) index] : 0;
    }

    public synchronized boolean getTimestamp(AudioTimestamp timestamp) {
        run();
        if (!StandInSound.stamps || !playing || (clock - started) * 1e-9 < StandInSound.firstStamp) {
            return false;
        }
        timestamp.framePosition = (long) heard(clock);
        timestamp.nanoTime = clock + (long) (1e9 * StandInSound.jitter * (2 * random.nextDouble() - 1));
        return true;
    }

    public synchronized int getPlaybackHeadPosition() {
        run();
        return (int) taken;
    }

    public synchronized void release() {
        playing = false;
    }

    public static class Builder {
        private int rate;
        private int bytes;

        public Builder() {}

        public Builder setAudioAttributes(AudioAttributes attributes) {
            return this;
        }

        public Builder setAudioFormat(AudioFormat format) {
            rate = format.rate;
            return this;
        }

        public Builder setBufferSizeInBytes(int bufferSizeInBytes) {
            bytes = bufferSizeInBytes;
            return this;
        }

        public Builder setTransferMode(int mode) {
            return this;
        }

        public AudioTrack build() {
            return new AudioTrack(rate, bytes);
        }
    }
}
