package org.visavis.demo;

import static org.visavis.demo.DemoCheck.equal;
import static org.visavis.demo.DemoCheck.isTrue;
import static org.visavis.demo.DemoCheck.near;

import java.io.ByteArrayInputStream;
import java.io.IOException;
import java.nio.file.Files;
import java.util.Arrays;
import org.visavis.FrameLayout;
import org.visavis.Skeleton;
import org.visavis.VisavisEngine;
import org.visavis.VisavisSession;

/** The body on its bones, and what it is drawn from. */
final class SceneTest {
    private SceneTest() {}

    /** The rig that a frame's rotations make is where the frame says that the joints are, but for the fit error that it tells. */
    static void testPoseIsTheFrames() throws Exception {
        try (VisavisEngine engine = VisavisEngine.fromFile(DemoCheck.bundle);
                VisavisSession session = engine.newSession()) {
            Skeleton skeleton = engine.skeleton();
            FrameLayout layout = session.layout();
            float[] block = new float[layout.blockFloats()];
            session.poll(0, block, 0);
            Pose pose = new Pose(skeleton, layout, stage().turns);
            pose.take(block);
            float[] at = new float[3];
            float[] carried = new float[3];
            for (int j = 0; j < skeleton.size(); j++) {
                pose.at(j, new float[3], at);
                for (int k = 0; k < 3; k++) {
                    near(block[layout.joint(0, j) + FrameLayout.POSITION + k], at[k], block[FrameLayout.FIT_ERROR] + 1e-4, skeleton.names().get(j));
                }
                // Skin at a joint goes with it, whether its parent carries it or itself.
                for (int bone : new int[] {j, Math.max(0, skeleton.parent(j))}) {
                    pose.carry(bone, pose.bound(j), carried, 0);
                    for (int k = 0; k < 3; k++) {
                        near(at[k], carried[k], 1e-4, skeleton.names().get(j) + " carried by " + skeleton.names().get(bone));
                    }
                }
            }
        }
    }

    private static byte[] asset() throws IOException {
        return Files.readAllBytes(DemoCheck.assets.resolve(StageData.ASSET));
    }

    private static StageData stage() throws IOException {
        return StageData.read(new ByteArrayInputStream(asset()));
    }

    static void testStageData() throws Exception {
        byte[] bytes = asset();
        StageData data = stage();
        isTrue(data.turns[0] == 0 && data.sleeve[3] > 0, "arms half lowered in the bind pose");
        isTrue(data.capsules.length > 4 && data.capsules.length < data.room, "room for the user's shadow");
        isTrue(data.body.count > 10_000 && data.body.count % 3 == 0, "triangles");
        for (int i = 0; i < data.body.count; i++) {
            int index = data.body.indices.getInt(4 * i);
            isTrue(index >= 0 && index < data.body.vertices.capacity() / StageData.Mesh.STRIDE, "index " + index);
        }
        for (String shader : data.shaders) {
            isTrue(shader.startsWith("#version 300 es"), "GLSL ES 3.0");
        }
        for (byte[] broken : new byte[][] {new byte[0], new byte[100], Arrays.copyOf(bytes, bytes.length / 2), Arrays.copyOf(bytes, 30)}) {
            try {
                StageData.read(new ByteArrayInputStream(broken));
                throw new AssertionError("read what is broken");
            } catch (IOException e) {
                isTrue(e.getMessage().contains(StageData.ASSET), e.getMessage());
            }
        }
    }

    static void testLines() {
        Lines lines = new Lines();
        lines.line(new float[] {0, 0, 0}, new float[] {0, 1, 0}, new float[] {0, 0, 5}, 0.2f, Lines.gaze(1), 1, 0);
        equal(6, lines.vertices());
        near(0.1, Math.abs(lines.buffer().get(0)), 1e-6, "half its width to the side");
        near(0, lines.buffer().get(2), 1e-6, "facing the eye");
        near(0.78, lines.buffer().get(4), 1e-6, "green for eye contact");
        for (int i = 0; i < 10; i++) {
            lines.ring(0, 0, 0.1f, 0.01f, Lines.gaze(0), 1);
        }
        isTrue(lines.vertices() <= 6 * 96, "no more than there is room for");
    }
}
