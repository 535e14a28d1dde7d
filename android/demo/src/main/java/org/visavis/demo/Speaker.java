package org.visavis.demo;

import android.media.AudioAttributes;
import android.media.AudioFormat;
import android.media.AudioTimestamp;
import android.media.AudioTrack;

/**
 * Plays the agent's voice, mono, from a session second on, and tells a {@link VoiceClock} what is heard. Sound is given ahead of time, as much as is asked
 * for and fits; nothing here waits.
 */
final class Speaker implements AutoCloseable {
    private static final int CHANNEL = AudioFormat.CHANNEL_OUT_MONO;
    private static final int ENCODING = AudioFormat.ENCODING_PCM_FLOAT;
    private static final int FLOAT_BYTES = 4;
    /** The output's time stamps settle in the first seconds; asking more often than needed costs power. */
    private static final long SETTLES = 2_000_000_000L;
    private static final long OFTEN = 50_000_000L;
    private static final long SELDOM = 1_000_000_000L;

    private final Wav voice;
    private final VoiceClock clock;
    private final AudioTrack track;
    private final AudioTimestamp stamp = new AudioTimestamp();
    private final float[] samples;
    /** Samples of the voice's stream before the track's first; negative: silence comes first. */
    private final long origin;
    private long written;
    private long started;
    private long asked;
    private long stamped;

    /**
     * A track that is paused.
     *
     * @param from session second of its first sample; below 0 it is silence
     * @param ahead seconds that it has room for
     * @throws UnsupportedOperationException where there is no output (IllegalArgumentException or IllegalStateException on some devices)
     */
    Speaker(Wav voice, VoiceClock clock, double from, double ahead) {
        this.voice = voice;
        this.clock = clock;
        origin = Math.round(from * voice.rate);
        samples = new float[voice.rate / 10];
        int bytes = Math.max(2 * Math.max(0, AudioTrack.getMinBufferSize(voice.rate, CHANNEL, ENCODING)), (int) (ahead * voice.rate) * FLOAT_BYTES);
        track = new AudioTrack.Builder()
            .setAudioAttributes(new AudioAttributes.Builder()
                .setUsage(AudioAttributes.USAGE_MEDIA)
                .setContentType(AudioAttributes.CONTENT_TYPE_SPEECH)
                .build())
            .setAudioFormat(new AudioFormat.Builder().setSampleRate(voice.rate).setEncoding(ENCODING).setChannelMask(CHANNEL).build())
            .setBufferSizeInBytes(bytes)
            .setTransferMode(AudioTrack.MODE_STREAM)
            .build();
        if (track.getState() != AudioTrack.STATE_INITIALIZED) {
            track.release();
            throw new UnsupportedOperationException("the device has no sound output");
        }
    }

    /** Goes on, with a full buffer: an output may not begin before. */
    void play(long now) {
        fill(given() + track.getBufferSizeInFrames() / (double) voice.rate);
        started = now;
        asked = 0;
        clock.start(now, true);
        track.play();
    }

    void pause(long now) {
        track.pause();
        clock.pause(now);
    }

    void volume(float share) {
        track.setVolume(share);
    }

    /** Session second up to which it has sound. */
    double given() {
        return (origin + written) / (double) voice.rate;
    }

    /** Gives the track sound up to a session second, as far as it takes it. Returns false when the output is gone: make another one. */
    boolean fill(double until) {
        long wanted = (long) Math.floor(until * voice.rate) - origin;
        while (written < wanted) {
            int count = (int) Math.min(samples.length, wanted - written);
            long at = origin + written;
            if (at < 0) {
                count = (int) Math.min(count, -at);
                java.util.Arrays.fill(samples, 0, count, 0);
            } else {
                voice.copy(at, samples, count);
            }
            int taken = track.write(samples, 0, count, AudioTrack.WRITE_NON_BLOCKING);
            if (taken < 0) {
                return false;
            }
            written += taken;
            if (taken < count) {
                break;
            }
        }
        clock.given(given());
        return true;
    }

    /** Tells the clock what is heard, often at first. */
    void watch(long now) {
        if (now - asked < (now - started < SETTLES ? OFTEN : SELDOM)) {
            return;
        }
        asked = now;
        if (track.getTimestamp(stamp) && stamp.framePosition > 0) {
            stamped = now;
            clock.stamp((origin + stamp.framePosition) / (double) voice.rate, stamp.nanoTime, now);
        } else if (now - Math.max(stamped, started) > SELDOM / 2) {
            // No time stamps on this output: what it has taken off the buffer, without its latency.
            clock.stamp((origin + (track.getPlaybackHeadPosition() & 0xffffffffL)) / (double) voice.rate, now, now);
        }
    }

    @Override
    public void close() {
        track.release();
    }
}
