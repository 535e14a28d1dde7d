package org.visavis.demo;

import java.io.FilterInputStream;
import java.io.IOException;
import java.io.InputStream;

/** How far loading has come, for a progress bar: steps of known weight, and the bytes of those that read. Any thread looks. */
final class Loading {
    private volatile String step = "";
    private volatile float done;
    private float weight;

    /** Begins a step that ends at {@code end} (0 to 1) of the whole. */
    void step(String name, float end) {
        done += weight;
        weight = Math.max(0, end - done);
        step = name;
    }

    void finished() {
        done = 1;
        weight = 0;
        step = "";
    }

    String step() {
        return step;
    }

    /** 0 to 1; never falls while one thread loads. */
    float fraction() {
        return done;
    }

    /** A stream that moves the bar through the current step while its {@code length} bytes are read. */
    InputStream watched(InputStream in, long length) {
        return new Watched(in, Math.max(1, length));
    }

    /** Reads a stream to its end for nothing but the system's file cache: what maps the same bytes afterwards does not wait for the storage. */
    static void readThrough(InputStream in) throws IOException {
        byte[] buffer = new byte[1 << 16];
        while (in.read(buffer) >= 0) {
            if (Thread.currentThread().isInterrupted()) {
                throw new IOException("loading was interrupted");
            }
        }
    }

    private final class Watched extends FilterInputStream {
        private final long length;
        private final float from = done;
        private final float room = weight;
        private long read;

        Watched(InputStream in, long length) {
            super(in);
            this.length = length;
        }

        @Override
        public int read() throws IOException {
            int value = super.read();
            count(value < 0 ? 0 : 1);
            return value;
        }

        @Override
        public int read(byte[] into, int offset, int count) throws IOException {
            int got = super.read(into, offset, count);
            count(Math.max(0, got));
            return got;
        }

        private void count(int bytes) {
            read += bytes;
            float part = room * Math.min(1, read / (float) length);
            done = from + part;
            weight = room - part;
        }
    }
}
