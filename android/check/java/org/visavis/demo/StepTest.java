package org.visavis.demo;

import static org.visavis.demo.DemoCheck.isTrue;
import static org.visavis.demo.DemoCheck.near;
import static org.visavis.demo.DemoCheck.wav;

import android.media.StandInSound;
import java.util.Arrays;
import org.visavis.VisavisEngine;

/** Motion, voice and clock together in real time, with an output that has latency: what is shown is in step with what is heard. */
final class StepTest {
    /** Seconds that picture and sound may be apart. */
    private static final double STEP = 0.040;

    private StepTest() {}

    private static Life running() {
        Life life = new Life();
        life.loaded();
        life.shown(true);
        life.focus(Life.Focus.HAD);
        return life;
    }

    /** Looks so often, or for ten seconds, and returns |shown - heard|, sorted. A look that the machine interrupted is no look. */
    private static double[] apart(Motion motion, double origin, int looks) throws InterruptedException {
        double[] apart = new double[looks];
        int count = 0;
        float[] pose = new float[motion.frames().layout().frameFloats()];
        long end = System.nanoTime() + 10_000_000_000L;
        while (System.nanoTime() < end && count < apart.length) {
            long now = System.nanoTime();
            double heard = origin + StandInSound.heardSamples() / 16_000;
            double shown = motion.frames().pose(motion.clock().heardSoon(now, StageView.SCREEN_DELAY), pose);
            if (System.nanoTime() - now < 2_000_000 && !Double.isNaN(shown)) {
                apart[count++] = Math.abs(shown - heard);
            }
            Thread.sleep(5);
        }
        isTrue(count > 30, "looked often enough: " + count);
        apart = Arrays.copyOf(apart, count);
        Arrays.sort(apart);
        return apart;
    }

    private static void inStep(double[] apart, String when) {
        double p95 = apart[(int) (0.95 * (apart.length - 1))];
        System.out.printf("%s: picture and sound apart by %.0f ms at most, in 95 of 100 moments by %.0f%n", when, 1000 * apart[apart.length - 1], 1000 * p95);
        isTrue(p95 <= STEP, when + ": apart by " + p95 + " s");
    }

    static void testVoiceInStepWithMotion() throws Exception {
        try (VisavisEngine engine = VisavisEngine.fromFile(DemoCheck.bundle)) {
            for (double latency : new double[] {0.05, 0.25}) {
                StandInSound.latency = latency;
                Life life = running();
                Wav agent = wav("agent.wav");
                Motion motion = new Motion(engine, agent, wav("user.wav"), life, new MicrophoneState());
                motion.start();
                Thread.sleep(700);
                inStep(apart(motion, -Motion.LEAD, 200), "latency " + latency + " s");
                voiceIsWhole(agent);

                life.shown(false);
                Thread.sleep(100);
                isTrue(!StandInSound.plays(), "a pause stops the voice");
                long blocks = motion.times().count();
                double heard = motion.clock().heard(System.nanoTime());
                Thread.sleep(400);
                isTrue(motion.times().count() == blocks, "a pause stops the blocks");
                near(heard, motion.clock().heard(System.nanoTime()), 0, "a pause stops the clock");
                life.shown(true);
                Thread.sleep(700);
                isTrue(StandInSound.plays() && motion.times().count() > blocks, "goes on");
                inStep(apart(motion, -Motion.LEAD, 100), "after a pause");
                // Blocks went on where they were: none was left out or made up for.
                near(motion.clock().heard(System.nanoTime()) + Motion.LEAD, motion.frames().end(), 0.3, "blocks per time");
                motion.finish();
                motion.join();
                isTrue(!StandInSound.plays(), "the end stops the voice");
            }
        } finally {
            StandInSound.latency = 0.12;
        }
    }

    /** What the track was given is silence for the lead and then the voice itself, nothing left out. */
    private static void voiceIsWhole(Wav agent) {
        int lead = (int) Math.round(Motion.LEAD * agent.rate);
        float[] voice = new float[agent.rate];
        agent.copy(0, voice, voice.length);
        for (int i = 0; i < lead; i++) {
            near(0, StandInSound.sample(i), 0, "silence first");
        }
        for (int i = 0; i < voice.length; i++) {
            near(voice[i], StandInSound.sample(lead + i), 0, "sample " + i);
        }
    }

    /** Another output in the middle of it: the voice goes on from what was heard. */
    static void testUnplugged() throws Exception {
        try (VisavisEngine engine = VisavisEngine.fromFile(DemoCheck.bundle)) {
            Motion motion = new Motion(engine, wav("agent.wav"), wav("user.wav"), running(), new MicrophoneState());
            motion.start();
            Thread.sleep(1200);
            double before = motion.clock().heard(System.nanoTime());
            StandInSound.unplug();
            Thread.sleep(700);
            isTrue(StandInSound.plays(), "plays on");
            double now = motion.clock().heard(System.nanoTime());
            isTrue(now > before && now < before + 1, "goes on, not far: " + before + " to " + now);
            motion.finish();
            motion.join();
        }
    }

    /** No output, or one without time stamps: the motion goes on. */
    static void testWithoutSound() throws Exception {
        try (VisavisEngine engine = VisavisEngine.fromFile(DemoCheck.bundle)) {
            for (boolean there : new boolean[] {false, true}) {
                StandInSound.there = there;
                StandInSound.stamps = false;
                Motion motion = new Motion(engine, wav("agent.wav"), wav("user.wav"), running(), new MicrophoneState());
                motion.start();
                Thread.sleep(1800);
                isTrue(motion.times().count() >= 6, "blocks: " + motion.times().count());
                isTrue(motion.note().contains("No sound") != there, "note: " + motion.note());
                motion.finish();
                motion.join();
            }
        } finally {
            StandInSound.there = true;
            StandInSound.stamps = true;
        }
    }
}
