package org.visavis;

import androidx.annotation.NonNull;
import androidx.annotation.Nullable;

/** Joints of OpenXR's body tracking extensions, by the extensions' own numbers, and how they map to VRM humanoid joints. */
public enum OpenXrBody {
    /** {@code XR_FB_body_tracking}: 70 joints, {@code XrBodyJointFB}; no legs. */
    FB_BODY_TRACKING(70),
    /** {@code XR_META_body_tracking_full_body}: the same and 14 of the legs, {@code XrFullBodyJointMETA}. */
    META_FULL_BODY(84);

    private static final String[] NAMES = Native.openXrNames();
    private static final String[] FOLLOWS = Native.openXrFollows();

    private final int size;

    OpenXrBody(int size) {
        this.size = size;
    }

    /** Number of joints. */
    public int size() {
        return size;
    }

    /** Name of a joint without prefix and suffix: "HIPS" for {@code XR_BODY_JOINT_HIPS_FB}. */
    @NonNull
    public String jointName(int joint) {
        return NAMES[checked(joint)];
    }

    /** VRM joint that a joint follows: its own, or the nearest one towards the hips; null for the root. */
    @Nullable
    public String follows(int joint) {
        return FOLLOWS[checked(joint)];
    }

    /** Number of the joint that stands for a VRM joint; -1 if this body has none. */
    public int jointOf(@NonNull String vrmName) {
        int joint = Native.openXrJoint(vrmName);
        return joint < size ? joint : -1;
    }

    private int checked(int joint) {
        if (joint < 0 || joint >= size) {
            throw new IndexOutOfBoundsException("joint " + joint + " of " + size);
        }
        return joint;
    }
}
