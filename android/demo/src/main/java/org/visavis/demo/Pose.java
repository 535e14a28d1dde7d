package org.visavis.demo;

import org.visavis.FrameLayout;
import org.visavis.Skeleton;

/** A frame on the rig with fixed bone lengths: where each joint is, and what carries the bind pose's skin there. */
final class Pose {
    private final Skeleton skeleton;
    private final FrameLayout layout;
    /** Where joints are in the bind pose, and by what angle about Z their frames are turned there. */
    private final float[] bind;
    private final float[] turns;
    private final float[] positions;
    private final float[] rotations;
    /** Three rows of four for each joint: a point of the bind pose to the world. */
    final float[] skin;
    private final float[] turned = new float[3];

    /** {@code turns}: of each joint's frame in the bind pose, about Z, radians; the T-pose is all zeros. */
    Pose(Skeleton skeleton, FrameLayout layout, float[] turns) {
        this.skeleton = skeleton;
        this.layout = layout;
        this.turns = turns;
        int joints = skeleton.size();
        bind = new float[3 * joints];
        positions = new float[3 * joints];
        rotations = new float[4 * joints];
        skin = new float[12 * joints];
        for (int j = 0; j < joints; j++) {
            int parent = Math.max(0, skeleton.parent(j));
            double angle = j == 0 ? 0 : turns[parent];
            float sin = (float) Math.sin(angle);
            float cos = (float) Math.cos(angle);
            float x = skeleton.restOffset(j, 0);
            float y = skeleton.restOffset(j, 1);
            float[] way = {cos * x - sin * y, sin * x + cos * y, skeleton.restOffset(j, 2)};
            for (int k = 0; k < 3; k++) {
                bind[3 * j + k] = way[k] + (j == 0 ? 0 : bind[3 * parent + k]);
            }
        }
    }

    /** Takes the pose of a frame. */
    void take(float[] frame) {
        for (int j = 0; j < skeleton.size(); j++) {
            int local = layout.joint(0, j) + FrameLayout.LOCAL;
            if (j == 0) {
                System.arraycopy(frame, local, rotations, 0, 4);
                System.arraycopy(frame, FrameLayout.HIPS, positions, 0, 3);
            } else {
                int parent = skeleton.parent(j);
                product(4 * parent, frame, local, 4 * j);
                turn(4 * parent, skeleton.restOffset(j, 0), skeleton.restOffset(j, 1), skeleton.restOffset(j, 2));
                for (int k = 0; k < 3; k++) {
                    positions[3 * j + k] = positions[3 * parent + k] + turned[k];
                }
            }
            matrix(j);
        }
    }

    private void product(int a, float[] frame, int b, int out) {
        float x = rotations[a];
        float y = rotations[a + 1];
        float z = rotations[a + 2];
        float w = rotations[a + 3];
        rotations[out] = w * frame[b] + x * frame[b + 3] + y * frame[b + 2] - z * frame[b + 1];
        rotations[out + 1] = w * frame[b + 1] - x * frame[b + 2] + y * frame[b + 3] + z * frame[b];
        rotations[out + 2] = w * frame[b + 2] + x * frame[b + 1] - y * frame[b] + z * frame[b + 3];
        rotations[out + 3] = w * frame[b + 3] - x * frame[b] - y * frame[b + 1] - z * frame[b + 2];
    }

    private void turn(int q, float vx, float vy, float vz) {
        float x = rotations[q];
        float y = rotations[q + 1];
        float z = rotations[q + 2];
        float w = rotations[q + 3];
        float tx = 2 * (y * vz - z * vy);
        float ty = 2 * (z * vx - x * vz);
        float tz = 2 * (x * vy - y * vx);
        turned[0] = vx + w * tx + y * tz - z * ty;
        turned[1] = vy + w * ty + z * tx - x * tz;
        turned[2] = vz + w * tz + x * ty - y * tx;
    }

    private void matrix(int j) {
        for (int column = 0; column < 3; column++) {
            turn(4 * j, column == 0 ? 1 : 0, column == 1 ? 1 : 0, column == 2 ? 1 : 0);
            for (int row = 0; row < 3; row++) {
                skin[12 * j + 4 * row + column] = turned[row];
            }
        }
        float sin = (float) Math.sin(turns[j]);
        float cos = (float) Math.cos(turns[j]);
        for (int row = 0; row < 3; row++) {
            int at = 12 * j + 4 * row;
            float x = skin[at];
            float y = skin[at + 1];
            skin[at] = x * cos - y * sin;
            skin[at + 1] = x * sin + y * cos;
            skin[at + 3] = positions[3 * j + row] - skin[at] * bind[3 * j] - skin[at + 1] * bind[3 * j + 1] - skin[at + 2] * bind[3 * j + 2];
        }
    }

    /** Where a joint is in the bind pose. */
    float[] bound(int joint) {
        return new float[] {bind[3 * joint], bind[3 * joint + 1], bind[3 * joint + 2]};
    }

    /** A point of the bind pose, carried by a joint, into {@code out} from {@code at} on. */
    void carry(int joint, float[] point, float[] out, int at) {
        for (int row = 0; row < 3; row++) {
            int m = 12 * joint + 4 * row;
            out[at + row] = skin[m] * point[0] + skin[m + 1] * point[1] + skin[m + 2] * point[2] + skin[m + 3];
        }
    }

    /** A point relative to a joint in its own coordinates, into {@code out}. */
    void at(int joint, float[] offset, float[] out) {
        turn(4 * joint, offset[0], offset[1], offset[2]);
        for (int k = 0; k < 3; k++) {
            out[k] = positions[3 * joint + k] + turned[k];
        }
    }
}
