package org.visavis.demo;

import android.opengl.GLES20;
import java.nio.Buffer;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import org.visavis.FrameLayout;
import org.visavis.Skeleton;

/** The stage in OpenGL ES 3.0, as the live page draws it: floor, agent, the user's headset, lines. For the thread that has the context. */
final class Scene {
    private static final float[] USER = {0.75f, 0.47f, 0.89f};

    private final StageData data;
    private final Pose pose;
    private final int head;
    private final Lines flat = new Lines();
    private final Lines upright = new Lines();
    private final float[] camera = new float[16];
    private final float[] eye = new float[3];
    private final float[] target = new float[3];
    private final float[] capsuleA;
    private final float[] capsuleB;
    private int capsules;

    private int bodyProgram;
    private int floorProgram;
    private int lineProgram;
    private final int[] buffers = new int[6];

    Scene(StageData data, Skeleton skeleton, FrameLayout layout) {
        if (data.joints != skeleton.size()) {
            throw new IllegalStateException(StageData.ASSET + " is of a rig with " + data.joints + " joints, the model has " + skeleton.size());
        }
        this.data = data;
        pose = new Pose(skeleton, layout, data.turns);
        head = Math.max(0, skeleton.indexOf("head"));
        capsuleA = new float[4 * data.room];
        capsuleB = new float[4 * data.room];
    }

    /** In a new context: programs and buffers. */
    void create() {
        bodyProgram = program(data.shaders[0], data.shaders[1]);
        floorProgram = program(data.shaders[2], data.shaders[3]);
        lineProgram = program(data.shaders[4], data.shaders[5]);
        GLES20.glGenBuffers(buffers.length, buffers, 0);
        upload(GLES20.GL_ARRAY_BUFFER, 0, data.body.vertices);
        upload(GLES20.GL_ELEMENT_ARRAY_BUFFER, 1, data.body.indices);
        upload(GLES20.GL_ARRAY_BUFFER, 2, data.headset.vertices);
        upload(GLES20.GL_ELEMENT_ARRAY_BUFFER, 3, data.headset.indices);
        ByteBuffer square = ByteBuffer.allocateDirect(32).order(ByteOrder.nativeOrder());
        square.asFloatBuffer().put(new float[] {-1, -1, 1, -1, -1, 1, 1, 1});
        upload(GLES20.GL_ARRAY_BUFFER, 4, square);
        GLES20.glEnable(GLES20.GL_BLEND);
        GLES20.glBlendFunc(GLES20.GL_ONE, GLES20.GL_ONE_MINUS_SRC_ALPHA);
        GLES20.glDepthFunc(GLES20.GL_LEQUAL);
    }

    private void upload(int kind, int which, ByteBuffer bytes) {
        GLES20.glBindBuffer(kind, buffers[which]);
        GLES20.glBufferData(kind, bytes.capacity(), bytes, GLES20.GL_STATIC_DRAW);
    }

    private static int program(String vertex, String fragment) {
        int program = GLES20.glCreateProgram();
        int[] done = new int[1];
        for (int i = 0; i < 2; i++) {
            int shader = GLES20.glCreateShader(i == 0 ? GLES20.GL_VERTEX_SHADER : GLES20.GL_FRAGMENT_SHADER);
            GLES20.glShaderSource(shader, i == 0 ? vertex : fragment);
            GLES20.glCompileShader(shader);
            GLES20.glGetShaderiv(shader, GLES20.GL_COMPILE_STATUS, done, 0);
            if (done[0] == 0) {
                throw new IllegalStateException("a shader does not compile: " + GLES20.glGetShaderInfoLog(shader));
            }
            GLES20.glAttachShader(program, shader);
        }
        GLES20.glLinkProgram(program);
        GLES20.glGetProgramiv(program, GLES20.GL_LINK_STATUS, done, 0);
        if (done[0] == 0) {
            throw new IllegalStateException("shaders do not link: " + GLES20.glGetProgramInfoLog(program));
        }
        return program;
    }

    /** Draws a moment: the agent in the pose of {@code frame} (null before the first), the user at a place on the floor, taken by a finger or not. */
    void draw(Projection view, int width, int height, float[] frame, float userX, float userZ, boolean taken) {
        view.matrix(width, height, camera);
        view.eye(eye);
        target[0] = view.centreX();
        target[2] = view.centreZ();
        if (frame != null) {
            pose.take(frame);
        }
        float[] user = {userX, Projection.HEAD, userZ};
        shadows(frame != null, user);
        lines(frame, user, taken);
        GLES20.glViewport(0, 0, width, height);
        GLES20.glClearColor(20 / 255f, 22 / 255f, 28 / 255f, 1);
        GLES20.glClear(GLES20.GL_COLOR_BUFFER_BIT | GLES20.GL_DEPTH_BUFFER_BIT);
        GLES20.glDisable(GLES20.GL_DEPTH_TEST);
        drawFloor();
        drawLines(flat);
        GLES20.glEnable(GLES20.GL_DEPTH_TEST);
        drawBodies(frame != null, user);
        GLES20.glDepthMask(false);
        drawLines(upright);
        GLES20.glDepthMask(true);
    }

    private void shadows(boolean there, float[] user) {
        capsules = 0;
        if (there) {
            for (StageData.Capsule capsule : data.capsules) {
                pose.carry(capsule.bone, capsule.a, capsuleA, 4 * capsules);
                pose.carry(capsule.bone, capsule.b, capsuleB, 4 * capsules);
                capsuleA[4 * capsules + 3] = capsule.radius;
                capsuleB[4 * capsules++ + 3] = 1;
            }
        }
        for (int k = 0; k < 3; k++) {
            capsuleA[4 * capsules + k] = user[k];
            capsuleB[4 * capsules + k] = user[k] + (k == 1 ? 0.03f : 0);
        }
        capsuleA[4 * capsules + 3] = 0.1f;
        capsuleB[4 * capsules++ + 3] = 0.8f;
    }

    private void lines(float[] frame, float[] user, boolean taken) {
        flat.clear();
        upright.clear();
        flat.ring(user[0], user[2], taken ? 0.17f : 0.14f, taken ? 0.03f : 0.018f, USER, 0.9f);
        float[] foot = {user[0], 0.006f, user[2]};
        upright.line(foot, new float[] {user[0], user[1] - 0.14f, user[2]}, eye, 0.007f, USER, 0.75f, 0.15f);
        if (frame == null) {
            return;
        }
        float[] colour = Lines.gaze(frame[FrameLayout.GAZE]);
        float[] eyes = new float[3];
        float[] back = new float[3];
        pose.at(head, data.eyes, eyes);
        pose.at(head, data.headBack, back);
        float x = eyes[0] - back[0];
        float y = eyes[1] - back[1];
        float z = eyes[2] - back[2];
        float unit = 1 / (float) Math.sqrt(x * x + y * y + z * z);
        float away = (float) Math.sqrt(square(user[0] - eyes[0]) + square(user[1] - eyes[1]) + square(user[2] - eyes[2]));
        float far = Math.min(2.2f, away) * unit;
        upright.line(new float[] {eyes[0] + 0.03f * unit * x, eyes[1] + 0.03f * unit * y, eyes[2] + 0.03f * unit * z},
                new float[] {eyes[0] + far * x, eyes[1] + far * y, eyes[2] + far * z}, eye, 0.011f, colour, 0.9f, 0);
        upright.dashes(eyes, user, eye, colour, 0.62f);
    }

    private static float square(float x) {
        return x * x;
    }

    private void common(int program) {
        GLES20.glUseProgram(program);
        GLES20.glUniformMatrix4fv(GLES20.glGetUniformLocation(program, "uView"), 1, false, camera, 0);
        GLES20.glUniform4fv(GLES20.glGetUniformLocation(program, "uCapA"), data.room, capsuleA, 0);
        GLES20.glUniform4fv(GLES20.glGetUniformLocation(program, "uCapB"), data.room, capsuleB, 0);
        GLES20.glUniform1i(GLES20.glGetUniformLocation(program, "uCaps"), capsules);
    }

    private static void attribute(int index, int size, int type, boolean share, int stride, int offset) {
        GLES20.glEnableVertexAttribArray(index);
        GLES20.glVertexAttribPointer(index, size, type, share, stride, offset);
    }

    private static void attributes(int count) {
        for (int i = count; i < 5; i++) {
            GLES20.glDisableVertexAttribArray(i);
        }
    }

    private void drawFloor() {
        common(floorProgram);
        GLES20.glUniform3fv(GLES20.glGetUniformLocation(floorProgram, "uCentre"), 1, target, 0);
        GLES20.glUniform3fv(GLES20.glGetUniformLocation(floorProgram, "uFloor"), 1, data.floor, 0);
        GLES20.glUniform4fv(GLES20.glGetUniformLocation(floorProgram, "uGrid"), 1, data.grid, 0);
        GLES20.glUniform1f(GLES20.glGetUniformLocation(floorProgram, "uDark"), data.dark);
        GLES20.glBindBuffer(GLES20.GL_ARRAY_BUFFER, buffers[4]);
        attributes(1);
        attribute(0, 2, GLES20.GL_FLOAT, false, 8, 0);
        GLES20.glDrawArrays(GLES20.GL_TRIANGLE_STRIP, 0, 4);
    }

    private void drawBodies(boolean there, float[] user) {
        common(bodyProgram);
        GLES20.glUniform3fv(GLES20.glGetUniformLocation(bodyProgram, "uEye"), 1, eye, 0);
        GLES20.glUniform3fv(GLES20.glGetUniformLocation(bodyProgram, "uTints"), 9, data.tints, 0);
        GLES20.glUniform3fv(GLES20.glGetUniformLocation(bodyProgram, "uClothes"), 3, data.clothes, 0);
        GLES20.glUniform3fv(GLES20.glGetUniformLocation(bodyProgram, "uCloth"), 1, data.cloth, 0);
        GLES20.glUniform4fv(GLES20.glGetUniformLocation(bodyProgram, "uSleeve"), 1, data.sleeve, 0);
        GLES20.glUniform1f(GLES20.glGetUniformLocation(bodyProgram, "uShade"), data.shade);
        GLES20.glUniform1f(GLES20.glGetUniformLocation(bodyProgram, "uAlpha"), 1);
        float yaw = (float) Math.PI;
        if (there) {
            drawMesh(0, data.body.count, pose.skin, data.joints);
            float[] eyes = new float[3];
            pose.at(head, data.eyes, eyes);
            yaw = (float) Math.atan2(eyes[0] - user[0], eyes[2] - user[2]);
        }
        // The headset faces the agent.
        float sin = (float) Math.sin(yaw);
        float cos = (float) Math.cos(yaw);
        drawMesh(2, data.headset.count, new float[] {cos, 0, sin, user[0], 0, 1, 0, user[1], -sin, 0, cos, user[2]}, 1);
    }

    private void drawMesh(int buffer, int count, float[] bones, int joints) {
        GLES20.glUniform4fv(GLES20.glGetUniformLocation(bodyProgram, "uBones"), 3 * joints, bones, 0);
        GLES20.glBindBuffer(GLES20.GL_ARRAY_BUFFER, buffers[buffer]);
        GLES20.glBindBuffer(GLES20.GL_ELEMENT_ARRAY_BUFFER, buffers[buffer + 1]);
        int stride = StageData.Mesh.STRIDE;
        attribute(0, 3, GLES20.GL_FLOAT, false, stride, 0);
        attribute(1, 3, GLES20.GL_FLOAT, false, stride, 12);
        attribute(2, 4, GLES20.GL_UNSIGNED_BYTE, false, stride, 24);
        attribute(3, 4, GLES20.GL_UNSIGNED_BYTE, true, stride, 28);
        attribute(4, 4, GLES20.GL_UNSIGNED_BYTE, true, stride, 32);
        GLES20.glDrawElements(GLES20.GL_TRIANGLES, count, GLES20.GL_UNSIGNED_INT, 0);
    }

    private void drawLines(Lines lines) {
        if (lines.vertices() == 0) {
            return;
        }
        GLES20.glUseProgram(lineProgram);
        GLES20.glUniformMatrix4fv(GLES20.glGetUniformLocation(lineProgram, "uView"), 1, false, camera, 0);
        GLES20.glBindBuffer(GLES20.GL_ARRAY_BUFFER, buffers[5]);
        Buffer all = lines.buffer();
        GLES20.glBufferData(GLES20.GL_ARRAY_BUFFER, lines.vertices() * Lines.STRIDE, all, GLES20.GL_DYNAMIC_DRAW);
        attributes(2);
        attribute(0, 3, GLES20.GL_FLOAT, false, Lines.STRIDE, 0);
        attribute(1, 4, GLES20.GL_FLOAT, false, Lines.STRIDE, 12);
        GLES20.glDrawArrays(GLES20.GL_TRIANGLES, 0, lines.vertices());
    }
}
