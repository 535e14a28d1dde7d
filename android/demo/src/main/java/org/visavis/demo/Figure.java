package org.visavis.demo;

import android.graphics.Canvas;
import android.graphics.Color;
import android.graphics.Paint;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.Comparator;
import java.util.List;
import org.visavis.FrameLayout;
import org.visavis.Skeleton;

/** The agent as rounded limbs in clothes, drawn from far to near on a canvas. */
final class Figure {
    private static final int SKIN = Color.rgb(230, 189, 166);
    private static final int SHIRT = Color.rgb(123, 154, 186);
    private static final int TROUSERS = Color.rgb(66, 70, 82);
    private static final int SHOES = Color.rgb(202, 199, 194);
    private static final int HAIR = Color.rgb(69, 59, 58);
    private static final int DARK = Color.rgb(24, 24, 30);
    private static final float HEAD_RADIUS = 0.105f;

    /** A rounded limb from one joint to another, or a ball beyond a joint. */
    private static final class Limb {
        final int from;
        final int to;
        final float radius;
        final int color;
        float depth;

        Limb(int from, int to, float radius, int color) {
            this.from = from;
            this.to = to;
            this.radius = radius;
            this.color = color;
        }
    }

    private final FrameLayout layout;
    private final int head;
    private final List<Limb> limbs = new ArrayList<Limb>();
    private final Limb[] sorted;
    private final Paint paint = new Paint(Paint.ANTI_ALIAS_FLAG);
    private final float[] a = new float[3];
    private final float[] b = new float[3];
    private final float[] point = new float[3];

    Figure(Skeleton skeleton, FrameLayout layout) {
        this.layout = layout;
        head = Math.max(0, skeleton.indexOf("head"));
        for (int j = 1; j < skeleton.size(); j++) {
            int parent = skeleton.parent(j);
            String name = skeleton.names().get(parent).replaceFirst("^(left|right)", "");
            limbs.add(new Limb(parent, j, radius(name), color(name)));
        }
        for (int j = 0; j < skeleton.size(); j++) {
            String name = skeleton.names().get(j).replaceFirst("^(left|right)", "");
            if (name.equals("Toes") || name.equals("Hand")) {
                limbs.add(new Limb(j, j, radius(name), color(name)));
            }
        }
        sorted = limbs.toArray(new Limb[0]);
    }

    /** Of the limb that begins at a joint. */
    private static float radius(String name) {
        switch (name) {
            case "hips":
                return 0.10f;
            case "spine":
            case "chest":
            case "upperChest":
                return 0.115f;
            case "neck":
                return 0.05f;
            case "Shoulder":
                return 0.065f;
            case "UpperArm":
                return 0.05f;
            case "LowerArm":
                return 0.037f;
            case "UpperLeg":
                return 0.078f;
            case "LowerLeg":
                return 0.055f;
            case "Foot":
            case "Toes":
                return 0.042f;
            case "Hand":
                return 0.045f;
            default:
                return 0.02f;
        }
    }

    private static int color(String name) {
        switch (name) {
            case "hips":
            case "UpperLeg":
            case "LowerLeg":
                return TROUSERS;
            case "spine":
            case "chest":
            case "upperChest":
            case "Shoulder":
            case "UpperArm":
                return SHIRT;
            case "Foot":
            case "Toes":
                return SHOES;
            default:
                return SKIN;
        }
    }

    /** Draws the pose that {@code frame} holds. */
    void draw(Canvas canvas, Projection view, float[] frame) {
        for (Limb limb : sorted) {
            joint(view, frame, limb.from, a);
            joint(view, frame, limb.to, b);
            limb.depth = -(a[2] + b[2]); // pixels per metre: more is nearer
        }
        Arrays.sort(sorted, FAR_TO_NEAR);
        paint.setStrokeCap(Paint.Cap.ROUND);
        boolean headDrawn = false;
        joint(view, frame, head, point);
        float headDepth = -2 * point[2];
        for (Limb limb : sorted) {
            if (!headDrawn && limb.depth < headDepth) {
                drawHead(canvas, view, frame);
                headDrawn = true;
            }
            joint(view, frame, limb.from, a);
            joint(view, frame, limb.to, b);
            float width = limb.radius * (a[2] + b[2]);
            stroke(canvas, width + Math.max(1, width / 12), shade(limb.color, 0.55f), 0);
            stroke(canvas, width * 0.94f, shade(limb.color, 0.82f), 0);
            stroke(canvas, width * 0.5f, limb.color, -0.14f * width);
        }
        if (!headDrawn) {
            drawHead(canvas, view, frame);
        }
    }

    private void stroke(Canvas canvas, float width, int color, float shift) {
        paint.setColor(color);
        paint.setStrokeWidth(width);
        // A hair's length at least: nothing is drawn of a line without one.
        canvas.drawLine(a[0] + shift, a[1] + shift / 2, b[0] + shift + 0.01f, b[1] + shift / 2, paint);
    }

    private void drawHead(Canvas canvas, Projection view, float[] frame) {
        local(view, frame, 0, 0.09f, 0.005f);
        ball(canvas, HEAD_RADIUS * 1.08f, shade(SKIN, 0.55f));
        ball(canvas, HEAD_RADIUS, SKIN);
        // Hair covers the half that faces away, and the top.
        local(view, frame, 0, 0.09f, 0.005f);
        float nearness = point[2];
        local(view, frame, 0, 0.125f, -0.035f);
        boolean away = facesAway(view, frame);
        ball(canvas, HEAD_RADIUS * (away ? 1.02f : 0.86f), HAIR);
        if (away) {
            return;
        }
        local(view, frame, 0, 0.075f, 0.03f);
        ball(canvas, HEAD_RADIUS * 0.86f, SKIN);
        paint.setColor(DARK);
        for (int side = -1; side <= 1; side += 2) {
            local(view, frame, 0.034f * side, 0.095f, 0.098f);
            canvas.drawCircle(point[0], point[1], 0.012f * nearness, paint);
        }
        local(view, frame, 0, 0.055f, 0.118f);
        paint.setColor(shade(SKIN, 0.8f));
        canvas.drawCircle(point[0], point[1], 0.013f * nearness, paint);
        local(view, frame, 0, 0.022f, 0.1f);
        paint.setColor(Color.rgb(170, 110, 104));
        paint.setStrokeWidth(0.012f * nearness);
        canvas.drawLine(point[0] - 0.018f * nearness, point[1], point[0] + 0.018f * nearness, point[1], paint);
    }

    /** Whether the face looks away from the camera: the nose is further than the back of the head. */
    private boolean facesAway(Projection view, float[] frame) {
        local(view, frame, 0, 0.08f, 0.1f);
        float nose = point[2];
        local(view, frame, 0, 0.08f, -0.1f);
        return nose < point[2];
    }

    private void ball(Canvas canvas, float radius, int color) {
        paint.setColor(color);
        canvas.drawCircle(point[0], point[1], radius * point[2], paint);
    }

    /** Screen place of a point in the head's coordinates: x left, y up, z to the front. */
    private void local(Projection view, float[] frame, float x, float y, float z) {
        int at = layout.joint(0, head);
        int q = at + FrameLayout.ROTATION;
        float qx = frame[q];
        float qy = frame[q + 1];
        float qz = frame[q + 2];
        float qw = frame[q + 3];
        float tx = 2 * (qy * z - qz * y);
        float ty = 2 * (qz * x - qx * z);
        float tz = 2 * (qx * y - qy * x);
        int p = at + FrameLayout.POSITION;
        view.project(frame[p] + x + qw * tx + qy * tz - qz * ty, frame[p + 1] + y + qw * ty + qz * tx - qx * tz,
                frame[p + 2] + z + qw * tz + qx * ty - qy * tx, point);
    }

    /** Where the head is seen, into {@code out}. */
    void head(Projection view, float[] frame, float[] out) {
        local(view, frame, 0, 0.09f, 0.06f);
        System.arraycopy(point, 0, out, 0, 3);
    }

    private void joint(Projection view, float[] frame, int joint, float[] out) {
        int at = layout.joint(0, joint) + FrameLayout.POSITION;
        view.project(frame[at], frame[at + 1], frame[at + 2], out);
    }

    private static int shade(int color, float share) {
        return Color.rgb(Math.round(share * (color >> 16 & 255)), Math.round(share * (color >> 8 & 255)), Math.round(share * (color & 255)));
    }

    private static final Comparator<Limb> FAR_TO_NEAR = new Comparator<Limb>() {
        @Override
        public int compare(Limb one, Limb other) {
            return Float.compare(other.depth, one.depth);
        }
    };
}
