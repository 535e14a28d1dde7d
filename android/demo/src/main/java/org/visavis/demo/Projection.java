package org.visavis.demo;

/**
 * How the stage is seen: a camera that looks down on the agent and on the floor where the user may stand, fitted both ways into what insets leave of a
 * view. World: metres, Y up; the agent faces +Z, and +X, its left, is right on the screen.
 */
final class Projection {
    /** Where the user may stand, relative to the middle of the stage, metres. */
    static final float REACH_X = 0.9f;
    static final float NEAR_Z = 0.7f;
    static final float FAR_Z = 1.9f;
    /** Height of the user's head, metres. */
    static final float HEAD = 1.65f;

    private static final float DISTANCE = 6;
    private static final float TARGET_Y = 0.9f;
    private static final float TARGET_Z = 0.6f;
    /** What must be in the picture, as x, y, z from and to: the agent with its arms out, and the user's heads and discs. */
    private static final float[][] BOXES = {
        {-0.7f, 0, -0.5f, 0.7f, 1.95f, 0.6f},
        {-REACH_X - 0.15f, 0, NEAR_Z, REACH_X + 0.15f, HEAD + 0.15f, FAR_Z + 0.15f},
    };

    final float left;
    final float top;
    final float right;
    final float bottom;
    private final float[] axes = new float[9]; // right, up, forward
    private final float scale;
    private final float originX;
    private final float originY;
    private volatile float centreX;
    private volatile float centreZ;

    /** Of a view of this size, of which the insets (pixels) are covered by something else. */
    Projection(float width, float height, float insetLeft, float insetTop, float insetRight, float insetBottom) {
        left = insetLeft;
        top = insetTop;
        right = Math.max(insetLeft + 1, width - insetRight);
        bottom = Math.max(insetTop + 1, height - insetBottom);
        // A tall view looks down more and along the line between the two; a wide one from the side.
        float wide = clamp(((right - left) / (bottom - top) - 0.7f) / 0.8f, 0, 1);
        float yaw = -0.25f - 0.4f * wide;
        float pitch = 0.5f - 0.2f * wide;
        float sinYaw = (float) Math.sin(yaw);
        float cosYaw = (float) Math.cos(yaw);
        float sinPitch = (float) Math.sin(pitch);
        float cosPitch = (float) Math.cos(pitch);
        set(0, cosYaw, 0, -sinYaw);
        set(3, -sinYaw * sinPitch, cosPitch, -cosYaw * sinPitch);
        set(6, -sinYaw * cosPitch, -sinPitch, -cosYaw * cosPitch);
        float[] span = {Float.MAX_VALUE, Float.MAX_VALUE, -Float.MAX_VALUE, -Float.MAX_VALUE};
        float[] at = new float[3];
        for (float[] box : BOXES) {
            for (int corner = 0; corner < 8; corner++) {
                eye(box[3 * (corner & 1)], box[1 + 3 * (corner >> 1 & 1)], box[2 + 3 * (corner >> 2)], at);
                span[0] = Math.min(span[0], at[0] / at[2]);
                span[1] = Math.min(span[1], at[1] / at[2]);
                span[2] = Math.max(span[2], at[0] / at[2]);
                span[3] = Math.max(span[3], at[1] / at[2]);
            }
        }
        scale = 0.96f * Math.min((right - left) / (span[2] - span[0]), (bottom - top) / (span[3] - span[1]));
        originX = (left + right) / 2 - scale * (span[0] + span[2]) / 2;
        originY = (top + bottom) / 2 + scale * (span[1] + span[3]) / 2;
    }

    private void set(int row, float x, float y, float z) {
        axes[row] = x;
        axes[row + 1] = y;
        axes[row + 2] = z;
    }

    /** Puts the middle of the stage, which the camera moves with, at a place on the floor. */
    void centre(float x, float z) {
        centreX = x;
        centreZ = z;
    }

    float centreX() {
        return centreX;
    }

    float centreZ() {
        return centreZ;
    }

    /** Coordinates along the camera's axes of a point relative to the middle of the stage; the third is its depth. */
    private void eye(float x, float y, float z, float[] out) {
        float dy = y - TARGET_Y;
        float dz = z - TARGET_Z;
        for (int i = 0; i < 3; i++) {
            out[i] = axes[3 * i] * x + axes[3 * i + 1] * dy + axes[3 * i + 2] * dz;
        }
        out[2] += DISTANCE;
    }

    /** Pixels right and down, and pixels per metre, of a point of the world. */
    void project(float x, float y, float z, float[] out) {
        eye(x - centreX, y, z - centreZ, out);
        float depth = Math.max(0.1f, out[2]);
        out[0] = originX + scale * out[0] / depth;
        out[1] = originY - scale * out[1] / depth;
        out[2] = scale / depth;
    }

    /**
     * The place at height {@code y} that is seen at a pixel, as x and z; false where the pixel shows nothing at that height before the horizon.
     */
    boolean unproject(float screenX, float screenY, float y, float[] out) {
        float a = (screenX - originX) / scale;
        float b = (originY - screenY) / scale;
        float dx = a * axes[0] + b * axes[3] + axes[6];
        float dy = a * axes[1] + b * axes[4] + axes[7];
        float dz = a * axes[2] + b * axes[5] + axes[8];
        float eyeX = -DISTANCE * axes[6];
        float eyeY = TARGET_Y - DISTANCE * axes[7];
        float eyeZ = TARGET_Z - DISTANCE * axes[8];
        float along = (y - eyeY) / dy;
        if (!(dy < -1e-3f) || along > 100) {
            return false;
        }
        out[0] = centreX + eyeX + along * dx;
        out[1] = centreZ + eyeZ + along * dz;
        return true;
    }

    /** Brings a place (x, z) to where the user may stand. */
    void clampToReach(float[] place) {
        place[0] = centreX + clamp(place[0] - centreX, -REACH_X, REACH_X);
        place[1] = centreZ + clamp(place[1] - centreZ, NEAR_Z, FAR_Z);
    }

    /** The camera's matrix for OpenGL (columns first): view and projection, for a view of this many pixels. */
    void matrix(float width, float height, float[] out) {
        float eyeX = centreX - DISTANCE * axes[6];
        float eyeY = TARGET_Y - DISTANCE * axes[7];
        float eyeZ = centreZ + TARGET_Z - DISTANCE * axes[8];
        float near = 0.5f;
        float far = 40;
        float depthScale = (far + near) / (far - near);
        float depthShift = -2 * far * near / (far - near);
        float shiftX = 2 * originX / width - 1;
        float shiftY = 1 - 2 * originY / height;
        for (int column = 0; column < 4; column++) {
            float r = column < 3 ? axes[column] : -(axes[0] * eyeX + axes[1] * eyeY + axes[2] * eyeZ);
            float u = column < 3 ? axes[3 + column] : -(axes[3] * eyeX + axes[4] * eyeY + axes[5] * eyeZ);
            float f = column < 3 ? axes[6 + column] : -(axes[6] * eyeX + axes[7] * eyeY + axes[8] * eyeZ);
            out[4 * column] = 2 * scale / width * r + shiftX * f;
            out[4 * column + 1] = 2 * scale / height * u + shiftY * f;
            out[4 * column + 2] = depthScale * f + (column == 3 ? depthShift : 0);
            out[4 * column + 3] = f;
        }
    }

    /** Where the camera is, x, y, z. */
    void eye(float[] out) {
        out[0] = centreX - DISTANCE * axes[6];
        out[1] = TARGET_Y - DISTANCE * axes[7];
        out[2] = centreZ + TARGET_Z - DISTANCE * axes[8];
    }

    private static float clamp(float value, float low, float high) {
        return Math.max(low, Math.min(high, value));
    }
}
