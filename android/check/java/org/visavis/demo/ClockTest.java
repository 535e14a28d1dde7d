package org.visavis.demo;

import static org.visavis.demo.DemoCheck.equal;
import static org.visavis.demo.DemoCheck.isTrue;
import static org.visavis.demo.DemoCheck.near;
import static org.visavis.demo.DemoCheck.wav;

import java.io.ByteArrayInputStream;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.FloatBuffer;
import java.util.Random;
import org.visavis.FrameLayout;
import org.visavis.VisavisEngine;
import org.visavis.VisavisSession;

/** What is heard, and the pose for it, in time that the test makes. */
final class ClockTest {
    private static final long MS = 1_000_000;

    private ClockTest() {}

    /** An output with latency, whose crystal is off, whose stamps jitter: the clock is within 40 ms of what is truly heard, and never runs back. */
    static void testFollowsTheOutput() {
        for (double latency : new double[] {0.03, 0.15, 0.3}) {
            Random random = new Random(7);
            VoiceClock clock = new VoiceClock(-0.2);
            clock.start(0, true);
            double last = -1;
            double worst = 0;
            for (long t = 0; t < 600_000; t += 10) {
                long now = t * MS;
                // The output swallows its latency first; then it runs 300 millionths fast.
                double truth = -0.2 + Math.max(0, t * 1e-3 - latency) * 1.0003;
                clock.given(truth + 0.5);
                boolean asks = t < 2000 ? t % 50 == 0 : t % 1000 == 0;
                if (asks && t * 1e-3 > latency) {
                    long jitter = (long) (random.nextGaussian() * 5 * MS);
                    clock.stamp(truth, now + jitter, now);
                }
                double heard = clock.heard(now);
                isTrue(heard >= last, "never backwards");
                last = heard;
                if (t > 1000 * latency + 100) {
                    worst = Math.max(worst, Math.abs(heard - truth));
                }
            }
            isTrue(worst < 0.040, "off by " + worst + " s with a latency of " + latency);
        }
    }

    /** Nothing moves before the output has said when it begins, but not for ever; without an output it runs at once. */
    static void testStart() {
        VoiceClock clock = new VoiceClock(-0.2);
        near(-0.2, clock.heard(0), 0, "before");
        clock.start(0, true);
        near(-0.2, clock.heard(300 * MS), 0, "waits");
        near(-0.2, clock.heard(401 * MS), 0.01, "patience ends");
        near(-0.1, clock.heard(501 * MS), 0.01, "runs");
        VoiceClock mute = new VoiceClock(-0.2);
        mute.start(0, false);
        near(0.8, mute.heard(1000 * MS), 1e-6, "without output");
    }

    /** A pause holds it; a stamp from before the pause does not move it; it goes on where it was. */
    static void testPause() {
        VoiceClock clock = new VoiceClock(0);
        clock.start(0, true);
        clock.stamp(0, 100 * MS, 100 * MS);
        near(0.4, clock.heard(500 * MS), 1e-6, "runs");
        clock.pause(500 * MS);
        near(0.4, clock.heard(9000 * MS), 1e-6, "holds");
        near(0.4, clock.heardSoon(9000 * MS, 0.03), 1e-6, "holds, and looks no further");
        clock.start(10_000 * MS, true);
        clock.stamp(0.4, 500 * MS, 10_050 * MS);
        near(0.4, clock.heard(10_100 * MS), 1e-6, "an old stamp says nothing");
        clock.stamp(0.41, 10_150 * MS, 10_160 * MS);
        near(0.46, clock.heard(10_200 * MS), 1e-6, "goes on");
    }

    /** Without sound to play nothing is heard, and the motion waits for it. */
    static void testStarved() {
        VoiceClock clock = new VoiceClock(0);
        clock.start(0, true);
        clock.given(1);
        clock.stamp(0, 0, 0);
        near(1, clock.heard(5000 * MS), 1e-9, "no further than the sound");
        near(1, clock.heardSoon(5000 * MS, 0.03), 1e-9, "nor the picture");
        clock.given(3);
        clock.stamp(1.1, 5100 * MS, 5100 * MS);
        near(1.2, clock.heard(5200 * MS), 1e-6, "from there on");
    }

    static void testPosesOfMoments() throws Exception {
        try (VisavisEngine engine = VisavisEngine.fromFile(DemoCheck.bundle);
                VisavisSession session = engine.newSession()) {
            FrameLayout layout = session.layout();
            FrameQueue queue = new FrameQueue(layout);
            float[] pose = new float[layout.frameFloats()];
            isTrue(Double.isNaN(queue.pose(0, pose)), "nothing yet");
            FloatBuffer block = ByteBuffer.allocateDirect(4 * layout.blockFloats()).order(ByteOrder.nativeOrder()).asFloatBuffer();
            for (int k = 0; k < 20; k++) {
                for (int i = 0; i < layout.blockFloats(); i++) {
                    block.put(i, 4 * k + i / layout.frameFloats());
                }
                queue.add(block);
            }
            near(80 / 30.0, queue.end(), 1e-9, "end");
            int hips = FrameLayout.HIPS;
            near(70.25 / 30, queue.pose(70.25 / 30, pose), 1e-9, "second");
            near(70.25, pose[hips], 1e-4, "between two frames");
            near(70.75, interpolated(queue, 70.75, pose)[hips], 1e-4, "nearer to the next");
            near(79, interpolated(queue, 500, pose)[hips], 0, "the last one stays");
            near(32, interpolated(queue, 3, pose)[hips], 0, "the oldest that is kept");
            int turn = layout.joint(0, 1) + FrameLayout.ROTATION;
            float norm = 0;
            for (int i = 0; i < 4; i++) {
                norm += pose[turn + i] * pose[turn + i];
            }
            near(1, norm, 1e-5, "a unit quaternion");
        }
    }

    private static float[] interpolated(FrameQueue queue, double frame, float[] pose) {
        queue.pose(frame / FrameQueue.FPS, pose);
        return pose;
    }

    static void testVoicesAreEndless() throws Exception {
        Wav voice = wav("agent.wav");
        float[] around = new float[voice.samples() + 100];
        voice.copy(voice.samples() - 50L, around, around.length);
        float[] start = new float[100];
        voice.copy(0, start, 100);
        for (int i = 0; i < 50; i++) {
            equal(start[i], around[50 + i]);
        }
        byte[] broken = new byte[64];
        try {
            Wav.read(new ByteArrayInputStream(broken), "broken.wav");
            throw new AssertionError("a broken file was read");
        } catch (java.io.IOException e) {
            isTrue(e.getMessage() == null || !e.getMessage().isEmpty(), "says so");
        }
    }

    static void testBlockTimes() {
        BlockTimes times = new BlockTimes(4);
        equal("No block yet", times.says());
        for (float ms : new float[] {9, 10, 20, 30, 40}) {
            times.add(ms);
        }
        float[] copy = new float[4];
        equal(4, times.copy(copy));
        equal(10f, copy[0]);
        float[] ranks = times.ranks();
        isTrue(ranks[0] == 20 && ranks[1] == 40 && ranks[2] == 40, "median, 95th percentile, maximum");
        equal("Block 20.0 ms, worst 40.0 of 133; 6.7 x real time", times.says());
    }
}
