package org.visavis.demo;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.FloatBuffer;

/** Lines as thin triangles, seven floats a vertex: position, colour. */
final class Lines {
    private static final int LINES = 96;
    private static final int VERTICES = 6;
    static final int STRIDE = 28;
    /** Of a gaze score from away over aside to eye contact. */
    private static final float[][] GAZE = {{0.95f, 0.42f, 0.36f}, {0.96f, 0.72f, 0.32f}, {0.22f, 0.78f, 0.62f}};

    private final FloatBuffer buffer = ByteBuffer.allocateDirect(LINES * VERTICES * STRIDE).order(ByteOrder.nativeOrder()).asFloatBuffer();
    private int count;

    void clear() {
        count = 0;
    }

    /** Vertices so far. */
    int vertices() {
        return VERTICES * count;
    }

    /** From its start. */
    FloatBuffer buffer() {
        return buffer;
    }

    static float[] gaze(float score) {
        float t = 2 * Math.max(0, Math.min(1, Float.isNaN(score) ? 0 : score));
        float[] a = GAZE[t < 1 ? 0 : 1];
        float[] b = GAZE[t < 1 ? 1 : 2];
        float part = t < 1 ? t : t - 1;
        return new float[] {a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]), a[2] + part * (b[2] - a[2])};
    }

    /** A circle on the floor. */
    void ring(float x, float z, float radius, float width, float[] colour, float alpha) {
        int pieces = 28;
        for (int k = 0; k < pieces; k++) {
            double a = 2 * Math.PI * k / pieces;
            double b = 2 * Math.PI * (k + 1) / pieces;
            float[] from = {x + radius * (float) Math.sin(a), 0.006f, z + radius * (float) Math.cos(a)};
            float[] to = {x + radius * (float) Math.sin(b), 0.006f, z + radius * (float) Math.cos(b)};
            add(from, to, new float[] {to[2] - from[2], 0, from[0] - to[0]}, width, colour, alpha, alpha);
        }
    }

    void dashes(float[] from, float[] to, float[] eye, float[] colour, float alpha) {
        float[] way = {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
        int pieces = Math.max(1, Math.min(40, Math.round(length(way) / 0.09f)));
        for (int k = 2; k < pieces; k++) {
            float a = k / (float) pieces;
            float b = (k + 0.45f) / pieces;
            line(new float[] {from[0] + a * way[0], from[1] + a * way[1], from[2] + a * way[2]},
                    new float[] {from[0] + b * way[0], from[1] + b * way[1], from[2] + b * way[2]}, eye, 0.007f, colour, alpha, alpha);
        }
    }

    /** A line that faces the eye. */
    void line(float[] from, float[] to, float[] eye, float width, float[] colour, float alphaFrom, float alphaTo) {
        float ax = to[0] - from[0];
        float ay = to[1] - from[1];
        float az = to[2] - from[2];
        float bx = eye[0] - from[0];
        float by = eye[1] - from[1];
        float bz = eye[2] - from[2];
        add(from, to, new float[] {ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx}, width, colour, alphaFrom, alphaTo);
    }

    private void add(float[] from, float[] to, float[] side, float width, float[] colour, float alphaFrom, float alphaTo) {
        if (count == LINES) {
            return;
        }
        float half = width / 2 / Math.max(1e-9f, length(side));
        int at = count++ * VERTICES * STRIDE / 4;
        for (int corner : new int[] {0, 1, 2, 2, 1, 3}) {
            float[] end = corner < 2 ? from : to;
            float sign = corner % 2 == 0 ? half : -half;
            for (int k = 0; k < 3; k++) {
                buffer.put(at + k, end[k] + sign * side[k]);
                buffer.put(at + 3 + k, colour[k]);
            }
            buffer.put(at + 6, corner < 2 ? alphaFrom : alphaTo);
            at += STRIDE / 4;
        }
    }

    private static float length(float[] v) {
        return (float) Math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    }
}
