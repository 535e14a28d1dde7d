package org.visavis;

import androidx.annotation.NonNull;
import java.util.Arrays;
import java.util.Collections;
import java.util.List;

/** The joints of a bundle's frames: VRM humanoid names, parents before children; at rest a T-pose facing +Z. */
public final class Skeleton {
    private final List<String> names;
    private final int[] parents;
    private final float[] offsets;

    Skeleton(String[] names, int[] parents, float[] offsets) {
        this.names = Collections.unmodifiableList(Arrays.asList(names));
        this.parents = parents;
        this.offsets = offsets;
    }

    /** Number of joints. */
    public int size() {
        return parents.length;
    }

    /** VRM humanoid names, such as "leftUpperArm". */
    @NonNull
    public List<String> names() {
        return names;
    }

    /** Index of the joint of this name; -1 if there is none. */
    public int indexOf(@NonNull String name) {
        return names.indexOf(name);
    }

    /** Index of a joint's parent; -1 for the hips. */
    public int parent(int joint) {
        return parents[joint];
    }

    /** Rest offset of a joint from its parent, metres; axis 0 to 2 for x, y, z. For the hips their place above the floor. */
    public float restOffset(int joint, int axis) {
        if (axis < 0 || axis > 2) {
            throw new IllegalArgumentException("axis " + axis + ": 0 to 2");
        }
        return offsets[3 * joint + axis];
    }

    /**
     * For each joint of an OpenXR body, the joint of this skeleton that it follows: its own, or the nearest one towards the hips
     * (fingers follow the hand); -1 for the root, which is the agent's place on the floor.
     */
    @NonNull
    public int[] forOpenXr(@NonNull OpenXrBody body) {
        int[] joints = new int[body.size()];
        for (int i = 0; i < joints.length; i++) {
            String follows = body.follows(i);
            joints[i] = follows == null ? -1 : indexOf(follows);
        }
        return joints;
    }
}
