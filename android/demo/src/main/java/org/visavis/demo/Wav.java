package org.visavis.demo;

import java.io.DataInputStream;
import java.io.IOException;
import java.io.InputStream;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;

/** A mono WAV file of 16-bit integers, as the samples are, as floats; heard over and over. */
final class Wav {
    final int rate;
    private final float[] samples;

    private Wav(int rate, float[] samples) {
        this.rate = rate;
        this.samples = samples;
    }

    int samples() {
        return samples.length;
    }

    /** Copies {@code count} samples of the endless voice, from its sample {@code from} on. */
    void copy(long from, float[] into, int count) {
        int at = (int) (from % samples.length);
        for (int done = 0; done < count; ) {
            int part = Math.min(count - done, samples.length - at);
            System.arraycopy(samples, at, into, done, part);
            done += part;
            at = 0;
        }
    }

    /** Reads and closes the stream. */
    static Wav read(InputStream stream, String name) throws IOException {
        try (DataInputStream in = new DataInputStream(stream)) {
            bytes(in, 12);
            int rate = 0;
            while (true) {
                ByteBuffer head = bytes(in, 8);
                int id = head.getInt();
                int length = head.getInt();
                if (length < 0 || length > 1 << 28) {
                    throw new IOException(name + ": not a WAV file");
                }
                ByteBuffer body = bytes(in, length + length % 2);
                if (id == 0x20746d66) { // "fmt "
                    if (length < 16 || body.getShort() != 1 || body.getShort() != 1 || body.getShort(14) != 16) {
                        throw new IOException(name + ": not mono 16-bit PCM");
                    }
                    rate = body.getInt(4);
                } else if (id == 0x61746164) { // "data"
                    if (rate < 8000 || length < 2) {
                        throw new IOException(name + ": no sound in it");
                    }
                    float[] samples = new float[length / 2];
                    for (int i = 0; i < samples.length; i++) {
                        samples[i] = body.getShort() / 32768f;
                    }
                    return new Wav(rate, samples);
                }
            }
        }
    }

    private static ByteBuffer bytes(DataInputStream in, int count) throws IOException {
        byte[] bytes = new byte[count];
        in.readFully(bytes);
        return ByteBuffer.wrap(bytes).order(ByteOrder.LITTLE_ENDIAN);
    }
}
