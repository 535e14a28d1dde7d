package org.visavis;

import static org.visavis.Check.direct;
import static org.visavis.Check.engine;
import static org.visavis.Check.equal;
import static org.visavis.Check.isTrue;

import java.nio.FloatBuffer;
import java.util.Arrays;

/** What a session does. */
final class SessionTest {
    private SessionTest() {}

    static void testFramesComeWhenTheyAreDue() throws Exception {
        try (VisavisEngine engine = engine();
                VisavisSession session = engine.newSession(new SessionOptions().gaze(0.8f))) {
            Conversation.push(session, 2, 48_000);
            FloatBuffer frames = direct(session.layout().blockFloats());
            equal(FrameLayout.FRAMES, session.poll(0, frames));
            equal(0, session.poll(1_000_000, frames));
            equal(0, frames.position());
            equal(133_333_333L, session.nextDueNanos());
            equal(FrameLayout.FRAMES, session.poll(session.nextDueNanos(), frames));
            for (int f = 0; f < FrameLayout.FRAMES; f++) {
                for (int j = 0; j < engine.skeleton().size(); j++) {
                    int at = session.layout().joint(f, j);
                    double norm = 0;
                    for (int i = 0; i < 4; i++) {
                        norm += frames.get(at + FrameLayout.LOCAL + i) * frames.get(at + FrameLayout.LOCAL + i);
                    }
                    isTrue(Math.abs(norm - 1) < 1e-4, "a unit quaternion");
                }
                isTrue(Math.abs(frames.get(session.layout().frame(f) + FrameLayout.GAZE)) <= 1, "gaze score");
            }
            SessionStats stats = session.stats();
            equal(2L, stats.blocks);
            isTrue(stats.headAccepted == 120 && stats.headNonFinite == 0, "heads");
            isTrue(stats.cacheBytes > 0 && stats.blockMsMax > 0, "figures");
        }
    }

    static void testBuffersAndArraysAreTheSame() throws Exception {
        try (VisavisEngine engine = engine();
                VisavisSession a = engine.newSession();
                VisavisSession b = engine.newSession(new SessionOptions().threads(2).coreMask(-1L))) {
            FloatBuffer voice = Conversation.voice(44_100, 44_100, 150, 0);
            float[] array = new float[voice.remaining() + 5];
            voice.get(array, 5, voice.remaining());
            voice.rewind();
            a.pushAgentAudio(voice, 44_100);
            a.pushUserAudio(voice, 44_100);
            for (int i = 5; i < array.length; i += 1000) {
                b.pushAgentAudio(array, i, Math.min(1000, array.length - i), 44_100);
            }
            b.pushUserAudio(array, 5, array.length - 5, 44_100);
            int floats = a.layout().blockFloats();
            FloatBuffer direct = direct(floats + 3);
            direct.position(3);
            float[] out = new float[floats + 2];
            for (int k = 0; k < 4; k++) {
                long due = a.nextDueNanos();
                equal(4, a.poll(due, direct));
                equal(4, b.poll(due, out, 2));
                float[] copy = new float[floats];
                direct.duplicate().get(copy);
                isTrue(Arrays.equals(copy, Arrays.copyOfRange(out, 2, out.length)), "block " + k);
            }
        }
    }

    static void testResetAndWarmUpReplay() throws Exception {
        try (VisavisEngine engine = engine();
                VisavisSession session = engine.newSession()) {
            float[] first = new float[session.layout().blockFloats()];
            session.poll(0, first, 0);
            session.reset();
            float[] second = new float[first.length];
            session.poll(0, second, 0);
            isTrue(Arrays.equals(first, second), "reset");
            session.warmUp();
            equal(0L, session.stats().blocks);
            session.poll(0, second, 0);
            isTrue(Arrays.equals(first, second), "warm-up");
            isTrue(session.sessionTimeNanos() >= 0, "clock");
        }
    }

    static void testSamplersAndGaze() throws Exception {
        try (VisavisEngine engine = engine();
                VisavisSession session = engine.newSession(new SessionOptions().sampler(Sampler.MIDPOINT2))) {
            equal(Sampler.MIDPOINT2, session.sampler());
            session.setSampler(Sampler.euler(8));
            equal("euler:8", session.sampler().toString());
            session.setGaze(1);
            session.setNaturalGaze();
            session.setGuidance(1.3f, 2);
            if (engine.hasStudent()) {
                session.setSampler(Sampler.SINGLE);
            }
            equal(4, session.poll(0, new float[session.layout().blockFloats()], 0));
        }
    }

    /** Block times are told, not measured: the outcome does not depend on the machine. */
    static void testBudget() throws Exception {
        try (VisavisEngine engine = engine();
                VisavisSession session = engine.newSession(new SessionOptions().budget(100))) {
            float[] out = new float[session.layout().blockFloats()];
            for (int k = 0; k < 12; k++) {
                session.poll(session.nextDueNanos(), out, 0);
                session.reportBlockTime(k < 8 ? 0.01 : 99_999);
                isTrue(out[FrameLayout.HELD] >= 0 && out[FrameLayout.EVALUATIONS] >= 1, "a frame says what made it");
            }
            SessionStats stats = session.stats();
            isTrue(stats.governorUp > 0, "climbs while there is time");
            isTrue(stats.governorDown > 0 && stats.governorMissed > 0, "gives way when blocks come late");
            session.setBudget(0);
            session.poll(session.nextDueNanos(), out, 0);
            equal(8f, out[FrameLayout.EVALUATIONS]);
        }
    }

    /** Blocks that come late are left to the featherweight tier, by block times that are told. */
    static void testFallback() throws Exception {
        try (VisavisEngine engine = engine();
                VisavisSession session = engine.newSession(new SessionOptions().budget(100))) {
            try (VisavisEngine light = Check.light()) {
                session.setFallback(light);
            }
            float[] out = new float[session.layout().blockFloats()];
            float[] shares = new float[FrameLayout.FRAMES * engine.skeleton().size()];
            long fell = 0;
            for (int k = 0; k < 60; k++) {
                equal(4, session.poll(session.nextDueNanos(), out, 0));
                int told = session.dyadic(shares, 0);
                isTrue(told == 0 || told == shares.length && shares[0] >= 0 && shares[told - 1] <= 1, "shares of a block");
                fell += told > 0 ? 1 : 0;
                session.reportBlockTime(told > 0 ? 5 : 99_999);
            }
            SessionStats stats = session.stats();
            isTrue(fell > 0, "the fallback makes blocks");
            equal(fell, stats.governorFallbackBlocks);
            equal(0L, stats.governorHeldBlocks);
        }
    }

    static void testTooMuchAndTooLittleSound() throws Exception {
        try (VisavisEngine engine = engine();
                VisavisSession session = engine.newSession()) {
            float[] second = new float[24_000];
            for (int i = 0; i < 70; i++) {
                session.pushAgentAudio(second, 0, second.length, 24_000);
            }
            session.pushUserAudio(second, 0, 100, 24_000);
            Arrays.fill(second, 100);
            session.pushAgentAudio(second, 0, 10, 24_000);
            float[] out = new float[session.layout().blockFloats()];
            for (int k = 0; k < 3; k++) {
                session.poll(session.nextDueNanos(), out, 0);
            }
            SessionStats stats = session.stats();
            equal(10L * 24_000 + 10, stats.agentVoice.overflowSamples);
            equal(10L, stats.agentVoice.clippedSamples);
            equal(2L * 3200 - 100, stats.userVoice.underrunSamples);
            equal(0L, stats.agentVoice.underrunSamples);
            equal(0L, stats.agentVoice.nonFiniteSamples + stats.agentVoice.badRateSamples + stats.agentVoice.contendedSamples);
            session.clearAgentAudio();
            session.finishAgentAudio();
            session.clearUserAudio();
            session.finishUserAudio();
            session.setAgentAudioPresent(false);
            session.setUserAudioPresent(true);
            equal(4, session.poll(session.nextDueNanos(), out, 0));
        }
    }

    /** The joints of a block beside a bang at (x, 1, -2), from a buffer or an array, if there is any. */
    private static float[] besideABang(VisavisEngine engine, int kind, float x, float sensitivity) {
        try (VisavisSession session = engine.newSession(new SessionOptions().sensitivity(sensitivity))) {
            float[] bang = new float[9_600];
            for (int i = 0; i < bang.length; i++) {
                bang[i] = (float) ((i * 7919) % 2000 - 1000) / 125;
            }
            if (kind == 1) {
                session.pushSound(-7, bang, 0, bang.length, 24_000, x, 1, -2);
            } else if (kind == 2) {
                FloatBuffer buffer = direct(bang.length);
                buffer.put(bang);
                buffer.flip();
                session.pushSound(-7, buffer, 24_000, x, 1, -2);
            }
            float[] out = new float[session.layout().blockFloats()];
            for (int k = 0; k < 4; k++) {
                equal(4, session.poll(session.nextDueNanos(), out, 0));
            }
            SessionStats.Sounds sounds = session.stats().sounds;
            isTrue(sounds.pieces == Math.min(kind, 1) && sounds.started == sounds.pieces && sounds.refused + sounds.replaced == 0, "counted");
            return out;
        }
    }

    static void testSoundsInTheRoom() throws Exception {
        try (VisavisEngine engine = Check.hearing();
                VisavisEngine deaf = engine()) {
            isTrue(engine.hasHearing() && !deaf.hasHearing(), "which bundle has hearing");
            float[] heard = besideABang(engine, 1, 1, 0);
            isTrue(Arrays.equals(heard, besideABang(engine, 2, 1, 0)), "a buffer is an array");
            isTrue(!Arrays.equals(heard, besideABang(engine, 0, 1, 0)), "a bang is heard");
            isTrue(!Arrays.equals(heard, besideABang(engine, 1, -1, 0)), "its place counts");
            isTrue(!Arrays.equals(heard, besideABang(engine, 1, 1, 1)), "sensitivity counts");
            besideABang(deaf, 0, 0, 1);
        }
    }

    /** What {@code heardPlace} writes behind a first float; null where nothing is known. */
    private static float[] heardPlace(VisavisSession session) {
        float[] out = {7, 8, 9, 10};
        boolean known = session.heardPlace(out, 1);
        equal(7f, out[0]);
        isTrue(known || Arrays.equals(out, new float[] {7, 8, 9, 10}), "what is not known is not written");
        return known ? Arrays.copyOfRange(out, 1, 4) : null;
    }

    static void testWhereTheAgentTakesASoundToBe() throws Exception {
        try (VisavisEngine engine = Check.hearing();
                VisavisEngine without = engine();
                VisavisSession session = engine.newSession(new SessionOptions().sampler(Sampler.SINGLE));
                VisavisSession deaf = without.newSession()) {
            float[] out = new float[session.layout().blockFloats()];
            session.poll(session.nextDueNanos(), out, 0);
            deaf.poll(0, out, 0);
            isTrue(heardPlace(session) == null && heardPlace(deaf) == null, "nothing is heard");
            float[] bang = new float[9_600];
            for (int i = 0; i < bang.length; i++) {
                bang[i] = (float) ((i * 7919) % 2000 - 1000) / 125;
            }
            session.pushSound(5, bang, 0, bang.length, 24_000, 1, 1.25f, -2);
            isTrue(heardPlace(session) == null, "no block has heard it");
            for (int k = 0; k < 3; k++) {
                session.poll(session.nextDueNanos(), out, 0);
            }
            isTrue(Arrays.equals(new float[] {1, 1.25f, -2}, heardPlace(session)), "the place of the source");
            // 0.4 s of some 100 dB, which fade by 45 dB a second to 35 dB; then two seconds.
            for (int k = 0; k < 16; k++) {
                session.poll(session.nextDueNanos(), out, 0);
            }
            isTrue(heardPlace(session) != null, "two seconds later it is known");
            for (int k = 0; k < 16; k++) {
                session.poll(session.nextDueNanos(), out, 0);
            }
            isTrue(heardPlace(session) == null, "after four it is forgotten");
            session.pushSound(5, bang, 0, bang.length, 24_000, 1, 1.25f, -2);
            for (int k = 0; k < 3; k++) {
                session.poll(session.nextDueNanos(), out, 0);
            }
            isTrue(heardPlace(session) != null, "heard once more");
            session.reset();
            isTrue(heardPlace(session) == null, "started anew");
        }
    }

    /** Two microphones, of which one hears first and louder: it comes from that side of the head. */
    static void testWhereEarsHearASound() throws Exception {
        try (VisavisEngine engine = Check.hearing()) {
            for (int nearer = 0; nearer < 2; nearer++) {
                try (VisavisSession session = engine.newSession(new SessionOptions().sampler(Sampler.SINGLE))) {
                    float[][] ears = new float[2][9_600];
                    int state = 1;
                    for (int i = 0; i < ears[0].length; i++) {
                        state = state * 1_664_525 + 1_013_904_223;
                        ears[nearer][i] = ((state >>> 16) / 65_536f - 0.5f) * 0.6f;
                        ears[1 - nearer][i] = i < 9 ? 0 : 0.7f * ears[nearer][i - 9];
                    }
                    session.pushEars(ears[0], ears[1], 0, ears[0].length, 24_000);
                    float[] before = new float[session.layout().blockFloats()];
                    session.poll(0, before, 0);
                    session.poll(session.nextDueNanos(), new float[before.length], 0);
                    float[] place = heardPlace(session);
                    int head = session.layout().joint(FrameLayout.FRAMES - 1, engine.skeleton().indexOf("head"));
                    float x = place[0] - before[head + FrameLayout.POSITION];
                    float z = place[2] - before[head + FrameLayout.POSITION + 2];
                    int turn = head + FrameLayout.ROTATION;
                    float qx = before[turn];
                    float qy = before[turn + 1];
                    float qz = before[turn + 2];
                    float qw = before[turn + 3];
                    // The head's X axis, which points to the left, along the floor.
                    double left = ((1 - 2 * (qy * qy + qz * qz)) * x + 2 * (qx * qz - qw * qy) * z) / Math.hypot(x, z);
                    isTrue(nearer == 0 ? left > 0.3 : left < -0.3, "side " + nearer + ": " + left);
                    equal(1.5f, place[1]);
                }
            }
        }
    }

    static void testLittleSoundAhead() throws Exception {
        try (VisavisEngine engine = engine();
                VisavisSession session = engine.newSession(new SessionOptions().voiceAhead(0.5))) {
            session.pushUserAudio(new float[24_000], 0, 24_000, 24_000);
            equal(12_000L, session.stats().userVoice.overflowSamples);
        }
    }

    static void testThreadsForPerformanceHints() throws Exception {
        try (VisavisEngine engine = engine();
                VisavisSession one = engine.newSession();
                VisavisSession two = engine.newSession(new SessionOptions().threads(2))) {
            equal(0, one.workerThreadIds().length);
            equal(1, two.workerThreadIds().length);
            isTrue(Visavis.currentThreadId() > 0 && two.workerThreadIds()[0] != Visavis.currentThreadId(), "ids");
            Visavis.pinCurrentThread(-1L);
            isTrue(Visavis.version().matches("\\d+\\.\\d+\\.\\d+.*"), Visavis.version());
        }
    }
}
