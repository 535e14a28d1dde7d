package org.visavis;

/**
 * Where things are in the floats that {@link VisavisSession#poll} writes: four frames, one after the other, each of 10 values and
 * 11 for each joint. Quaternions are x, y, z, w.
 *
 * <pre>
 * frame: root x, root z, root yaw | hips x, y, z | gaze score | fit error | held | evaluations | joints
 * joint: local rotation 4 | world position 3 | world rotation 4
 * </pre>
 *
 * Local rotations are relative to the parent on the rig with fixed bone lengths (hips: relative to the world), for humanoid rigs; place
 * the rig's hips at {@link #HIPS}. World positions and rotations are as decoded; the fit error is their largest distance from the rig, metres. The gaze score is
 * -1 to 1, or NaN while the user's position is not known. Held is how much of the frame is a held pose instead of the model's, 0 to 1; evaluations
 * tells which sampler made it: of the network, a block.
 */
public final class FrameLayout {
    /** Frames of a poll. */
    public static final int FRAMES = 4;
    /** Offset in a frame: root x and z (metres) and yaw (radians: the agent faces (sin yaw, 0, cos yaw)). */
    public static final int ROOT = 0;
    /** Offset in a frame: position of the hips, metres. */
    public static final int HIPS = 3;
    /** Offset in a frame: gaze score. */
    public static final int GAZE = 6;
    /** Offset in a frame: fit error, metres. */
    public static final int FIT_ERROR = 7;
    /** Offset in a frame: how much of it is a held pose, 0 to 1. */
    public static final int HELD = 8;
    /** Offset in a frame: evaluations of the network that its block took. */
    public static final int EVALUATIONS = 9;
    /** Offset in a joint: local rotation. */
    public static final int LOCAL = 0;
    /** Offset in a joint: world position. */
    public static final int POSITION = 4;
    /** Offset in a joint: world rotation. */
    public static final int ROTATION = 7;

    private static final int HEAD = 10;
    private static final int JOINT = 11;

    private final int joints;

    FrameLayout(int joints) {
        this.joints = joints;
    }

    /** Floats of one frame. */
    public int frameFloats() {
        return HEAD + JOINT * joints;
    }

    /** Floats of a block: the room that a poll needs. */
    public int blockFloats() {
        return FRAMES * frameFloats();
    }

    /** Index of the first float of frame {@code frame} (0 to 3). */
    public int frame(int frame) {
        return frame * frameFloats();
    }

    /** Index of the first float of a joint; add {@link #LOCAL}, {@link #POSITION} or {@link #ROTATION}. */
    public int joint(int frame, int joint) {
        return frame(frame) + HEAD + JOINT * joint;
    }
}
