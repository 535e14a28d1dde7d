package org.visavis.demo;

import java.io.ByteArrayOutputStream;
import java.io.IOException;
import java.io.InputStream;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.charset.Charset;

/** What the stage is drawn from, as android/apk/stage.mjs writes it: the live page's body, shaders and colours. */
final class StageData {
    static final String ASSET = "stage.bin";
    private static final int MAGIC = 0x47545356; // "VSTG"

    /** Triangles; a vertex is 36 bytes: position, normal (f32), four bones, four weights (u8), tint, occlusion, place on an eye (u8). */
    static final class Mesh {
        static final int STRIDE = 36;
        final ByteBuffer vertices;
        final ByteBuffer indices;
        final int count;

        Mesh(ByteBuffer in) {
            int points = in.getInt();
            count = in.getInt();
            vertices = part(in, STRIDE * points);
            indices = part(in, 4 * count);
        }
    }

    /** What casts the shadow of a bone: from a to b in the bind pose. */
    static final class Capsule {
        final int bone;
        final float[] a;
        final float[] b;
        final float radius;

        Capsule(ByteBuffer in) {
            bone = in.getInt();
            a = floats(in, 3);
            b = floats(in, 3);
            radius = in.getFloat();
        }
    }

    final int joints;
    final float[] eyes;
    final float[] headBack;
    /** Of each joint in the bind pose, about Z, radians. */
    final float[] turns;
    final float[] cloth;
    final float[] sleeve;
    final float[] floor;
    final float[] grid;
    final float dark;
    final float shade;
    final float[] tints;
    final float[] clothes;
    /** Shadow capsules that the shaders have room for. */
    final int room;
    final Capsule[] capsules;
    /** Body, floor, lines: vertex and fragment shader of each. */
    final String[] shaders = new String[6];
    final Mesh body;
    final Mesh headset;

    private StageData(ByteBuffer in) {
        joints = in.getInt();
        eyes = floats(in, 3);
        headBack = floats(in, 3);
        turns = floats(in, joints);
        cloth = floats(in, 3);
        sleeve = floats(in, 4);
        floor = floats(in, 3);
        grid = floats(in, 4);
        dark = in.getFloat();
        shade = in.getFloat();
        tints = floats(in, 27);
        clothes = floats(in, 9);
        room = in.getInt();
        capsules = new Capsule[in.getInt()];
        for (int i = 0; i < capsules.length; i++) {
            capsules[i] = new Capsule(in);
        }
        for (int i = 0; i < shaders.length; i++) {
            byte[] text = new byte[in.getInt()];
            in.get(text);
            shaders[i] = new String(text, Charset.forName("UTF-8"));
        }
        body = new Mesh(in);
        headset = new Mesh(in);
    }

    /** Reads and closes the stream. */
    static StageData read(InputStream stream) throws IOException {
        ByteArrayOutputStream bytes = new ByteArrayOutputStream();
        byte[] part = new byte[1 << 16];
        try (InputStream in = stream) {
            for (int got = in.read(part); got >= 0; got = in.read(part)) {
                bytes.write(part, 0, got);
            }
        }
        ByteBuffer in = ByteBuffer.wrap(bytes.toByteArray()).order(ByteOrder.LITTLE_ENDIAN);
        try {
            if (in.getInt() != MAGIC) {
                throw new IOException(ASSET + " is not what android/apk/stage.mjs writes");
            }
            return new StageData(in);
        } catch (java.nio.BufferUnderflowException | NegativeArraySizeException e) {
            throw new IOException(ASSET + " is cut short", e);
        }
    }

    private static float[] floats(ByteBuffer in, int count) {
        float[] values = new float[count];
        for (int i = 0; i < count; i++) {
            values[i] = in.getFloat();
        }
        return values;
    }

    private static ByteBuffer part(ByteBuffer in, int bytes) {
        byte[] copy = new byte[bytes];
        in.get(copy);
        ByteBuffer direct = ByteBuffer.allocateDirect(bytes).order(ByteOrder.nativeOrder());
        direct.put(copy);
        ((java.nio.Buffer) direct).position(0); // not ByteBuffer's own, which API 29 lacks
        return direct;
    }
}
