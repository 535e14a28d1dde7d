package org.visavis.demo;

import android.media.AudioAttributes;
import android.media.AudioFormat;
import android.media.AudioTrack;
import java.nio.FloatBuffer;

/**
 * Plays the agent's voice, mono, as it is pushed to the session: a block when its motion starts. Sound comes later than motion by the output's own
 * latency. What does not fit into the track's buffer is dropped; motion keeps the time.
 */
final class Speaker implements AutoCloseable {
    private static final int CHANNEL = AudioFormat.CHANNEL_OUT_MONO;
    private static final int ENCODING = AudioFormat.ENCODING_PCM_FLOAT;

    private final AudioTrack track;
    private float[] samples = new float[0];

    /** Starts a track of {@code rate} Hz with room for two blocks of {@code block} samples; UnsupportedOperationException where there is no output. */
    Speaker(int rate, int block) {
        int bytes = Math.max(AudioTrack.getMinBufferSize(rate, CHANNEL, ENCODING), 2 * Float.BYTES * block);
        track = new AudioTrack.Builder()
            .setAudioAttributes(new AudioAttributes.Builder()
                .setUsage(AudioAttributes.USAGE_MEDIA)
                .setContentType(AudioAttributes.CONTENT_TYPE_SPEECH)
                .build())
            .setAudioFormat(new AudioFormat.Builder().setSampleRate(rate).setEncoding(ENCODING).setChannelMask(CHANNEL).build())
            .setBufferSizeInBytes(bytes)
            .setTransferMode(AudioTrack.MODE_STREAM)
            .build();
        track.play();
    }

    /** Plays what is left in {@code voice}, after what was played before; never waits. */
    void play(FloatBuffer voice) {
        int count = voice.remaining();
        if (samples.length < count) {
            samples = new float[count];
        }
        voice.get(samples, 0, count);
        track.write(samples, 0, count, AudioTrack.WRITE_NON_BLOCKING);
    }

    @Override
    public void close() {
        track.release();
    }
}
