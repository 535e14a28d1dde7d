package org.visavis.demo;

import android.content.res.AssetManager;
import java.io.DataInputStream;
import java.io.IOException;
import java.io.InputStream;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.FloatBuffer;

/** A mono WAV file of 16-bit integers, as the samples are, in a direct buffer of floats. */
final class Wav {
    final int rate;
    final FloatBuffer samples;

    private Wav(int rate, FloatBuffer samples) {
        this.rate = rate;
        this.samples = samples;
    }

    static Wav fromAsset(AssetManager assets, String name) throws IOException {
        try (InputStream in = assets.open(name)) {
            return read(in, name);
        }
    }

    static Wav read(InputStream stream, String name) throws IOException {
        DataInputStream in = new DataInputStream(stream);
        byte[] riff = new byte[12];
        in.readFully(riff);
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
                if (body.getShort() != 1 || body.getShort() != 1 || body.getShort(14) != 16) {
                    throw new IOException(name + ": not mono 16-bit PCM");
                }
                rate = body.getInt(4);
            } else if (id == 0x61746164) { // "data"
                FloatBuffer samples = ByteBuffer.allocateDirect(2 * length).order(ByteOrder.nativeOrder()).asFloatBuffer();
                for (int i = 0; i < length / 2; i++) {
                    samples.put(i, body.getShort() / 32768f);
                }
                return new Wav(rate, samples);
            }
        }
    }

    private static ByteBuffer bytes(DataInputStream in, int count) throws IOException {
        byte[] bytes = new byte[count];
        in.readFully(bytes);
        return ByteBuffer.wrap(bytes).order(ByteOrder.LITTLE_ENDIAN);
    }
}
