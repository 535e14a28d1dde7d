package org.visavis.demo;

import static org.visavis.demo.DemoCheck.isTrue;
import static org.visavis.demo.DemoCheck.near;

/** What the stage shows, and where a finger on it is in the world. */
final class ProjectionTest {
    /** Width, height and insets (left, top, right, bottom): panel, phone upright and on its side, tablet, square, small, very wide. */
    private static final float[][] VIEWS = {
        {960, 800, 0, 0, 0, 0}, {1080, 1700, 0, 90, 0, 60}, {1900, 1080, 120, 0, 0, 48}, {1600, 2560, 0, 48, 0, 48}, {1000, 1000, 0, 0, 0, 0},
        {360, 320, 0, 0, 0, 0}, {2400, 700, 0, 0, 0, 0},
    };

    private ProjectionTest() {}

    private static Projection of(float[] view) {
        Projection projection = new Projection(view[0], view[1], view[2], view[3], view[4], view[5]);
        projection.centre(0.4f, -0.3f);
        return projection;
    }

    static void testAgentAndUserAreInsideBothWays() {
        float[] at = new float[3];
        for (float[] view : VIEWS) {
            Projection projection = of(view);
            float[][] points = {
                {0, 0, 0}, {0, 1.9f, 0}, {0.7f, 1.4f, 0}, {-0.7f, 1.4f, 0}, {0, 0, 0.5f},
                {-Projection.REACH_X, 0, Projection.NEAR_Z}, {Projection.REACH_X, 0, Projection.FAR_Z},
                {Projection.REACH_X, 0, Projection.NEAR_Z}, {-Projection.REACH_X, 0, Projection.FAR_Z},
                {-Projection.REACH_X, Projection.HEAD, Projection.FAR_Z}, {Projection.REACH_X, Projection.HEAD, Projection.NEAR_Z},
                {Projection.REACH_X, Projection.HEAD, Projection.FAR_Z}, {-Projection.REACH_X, Projection.HEAD, Projection.NEAR_Z},
            };
            float low = Float.MAX_VALUE;
            float high = -Float.MAX_VALUE;
            float left = Float.MAX_VALUE;
            float right = -Float.MAX_VALUE;
            for (float[] p : points) {
                projection.project(p[0] + 0.4f, p[1], p[2] - 0.3f, at);
                isTrue(at[0] >= view[2] && at[0] <= view[0] - view[4], "x " + at[0] + " of " + view[0] + " x " + view[1]);
                isTrue(at[1] >= view[3] && at[1] <= view[1] - view[5], "y " + at[1] + " of " + view[0] + " x " + view[1]);
                low = Math.min(low, at[1]);
                high = Math.max(high, at[1]);
                left = Math.min(left, at[0]);
                right = Math.max(right, at[0]);
            }
            float wide = (right - left) / (view[0] - view[2] - view[4]);
            float tall = (high - low) / (view[1] - view[3] - view[5]);
            isTrue(Math.max(wide, tall) > 0.8f, "fills one way: " + wide + " and " + tall + " of " + view[0] + " x " + view[1]);
        }
    }

    /** The agent faces the camera: its left hand (+X) is at the right, up is up, and nearer is larger and lower. */
    static void testOrientation() {
        float[] a = new float[3];
        float[] b = new float[3];
        for (float[] view : VIEWS) {
            Projection projection = of(view);
            projection.project(0.5f, 1, 0, a);
            projection.project(-0.5f, 1, 0, b);
            isTrue(a[0] > b[0], "left hand at the right");
            projection.project(0, 1, 0, b);
            projection.project(0, 1.5f, 0, a);
            isTrue(a[1] < b[1], "up");
            projection.project(0, 0, 0, a);
            projection.project(0, 0, 1, b);
            isTrue(b[1] > a[1] && b[2] > a[2], "near");
        }
    }

    static void testUnprojectInverts() {
        float[] at = new float[3];
        float[] back = new float[2];
        for (float[] view : VIEWS) {
            Projection projection = of(view);
            for (float height : new float[] {0, Projection.HEAD}) {
                for (float x = -1; x <= 2; x += 0.5f) {
                    for (float z = -1; z <= 2; z += 0.5f) {
                        projection.project(x, height, z, at);
                        isTrue(projection.unproject(at[0], at[1], height, back), "seen");
                        near(x, back[0], 2e-3, "x");
                        near(z, back[1], 2e-3, "z");
                    }
                }
            }
            isTrue(!projection.unproject(view[0] / 2, -20 * view[1], 0, back), "the sky is no place");
        }
    }

    /** The matrix for OpenGL puts points where the canvas has them. */
    static void testMatrix() {
        float[] m = new float[16];
        float[] at = new float[3];
        for (float[] view : VIEWS) {
            Projection projection = of(view);
            projection.matrix(view[0], view[1], m);
            float[] p = {0.7f, 1.3f, 0.9f, 1};
            float[] clip = new float[4];
            for (int row = 0; row < 4; row++) {
                for (int column = 0; column < 4; column++) {
                    clip[row] += m[4 * column + row] * p[column];
                }
            }
            projection.project(p[0], p[1], p[2], at);
            near(at[0], (clip[0] / clip[3] + 1) / 2 * view[0], 0.1, "x");
            near(at[1], (1 - clip[1] / clip[3]) / 2 * view[1], 0.1, "y");
            isTrue(Math.abs(clip[2] / clip[3]) < 1, "depth");
        }
    }

    /** Wherever the finger goes within reach, the disc or head that it took is under it. */
    static void testDiscFollowsTheFinger() {
        float[] at = new float[3];
        float[] user = new float[2];
        for (float[] view : VIEWS) {
            Projection projection = of(view);
            for (float height : new float[] {0, Projection.HEAD}) {
                Drag drag = new Drag(30);
                user[0] = 0.4f;
                user[1] = 1.2f;
                projection.project(user[0], height, user[1], at);
                float offX = 3;
                float offY = -2;
                drag.begin(projection, at[0] + offX, at[1] + offY, user);
                near(0.4, user[0], 1e-3, "taking it does not move it");
                near(height, drag.height(), 0, "takes what it touches");
                for (float x = -0.9f; x <= 0.9f; x += 0.3f) {
                    for (float z = 0.8f; z <= 1.8f; z += 0.2f) {
                        projection.project(0.4f + x, height, z - 0.3f, at);
                        float fingerX = at[0] + offX;
                        float fingerY = at[1] + offY;
                        drag.move(projection, fingerX, fingerY, user);
                        projection.project(user[0], height, user[1], at);
                        near(fingerX - offX, at[0], 0.5, "under the finger, across");
                        near(fingerY - offY, at[1], 0.5, "under the finger, down");
                    }
                }
            }
        }
    }

    static void testDownIsNearerAndRightIsRight() {
        for (float[] view : VIEWS) {
            Projection projection = of(view);
            float[] at = new float[3];
            projection.project(0.4f, 0, 1.2f, at);
            float[] user = {0.4f, 1.2f};
            Drag drag = new Drag(30);
            drag.begin(projection, at[0], at[1], user);
            drag.move(projection, at[0], at[1] + 0.05f * view[1], user);
            isTrue(user[1] > 1.25f, "down: nearer to the camera, got z " + user[1]);
            drag.move(projection, at[0] + 0.05f * view[0], at[1], user);
            isTrue(user[0] > 0.45f, "right: towards the agent's left, got x " + user[0]);
        }
    }

    /** A touch far from both brings the disc; one beyond the reach, or in the sky, leaves the user where he may be. */
    static void testTouchElsewhere() {
        Projection projection = of(VIEWS[0]);
        float[] at = new float[3];
        float[] user = {0.4f, 1.2f};
        projection.project(-0.4f, 0, 1.3f, at);
        Drag drag = new Drag(30);
        drag.begin(projection, at[0], at[1], user);
        near(-0.4, user[0], 1e-2, "x");
        near(1.3, user[1], 1e-2, "z");
        drag.move(projection, -5000, 790, user);
        isTrue(user[0] >= 0.4f - Projection.REACH_X - 1e-4f && user[1] <= -0.3f + Projection.FAR_Z + 1e-4f, "reach");
        float x = user[0];
        drag.move(projection, 400, -100_000, user);
        near(x, user[0], 0, "the sky moves nothing");
        drag.end();
        drag.move(projection, 400, 600, user);
        near(x, user[0], 0, "no finger, no move");
    }
}
