package org.visavis;

import static org.visavis.Check.direct;
import static org.visavis.Check.engine;
import static org.visavis.Check.throwsWith;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.FloatBuffer;

/** Every wrong use is a typed exception, and leaves things as they were. */
final class ErrorTest {
    private static final Class<IllegalArgumentException> ARGUMENT = IllegalArgumentException.class;
    private static final Class<IllegalStateException> STATE = IllegalStateException.class;

    private ErrorTest() {}

    static void testBuffers() throws Exception {
        try (VisavisEngine engine = engine();
                VisavisSession session = engine.newSession()) {
            int floats = session.layout().blockFloats();
            throwsWith(ARGUMENT, "not direct", () -> session.poll(0, FloatBuffer.allocate(floats)));
            throwsWith(ARGUMENT, "blockFloats", () -> session.poll(0, direct(floats - 1)));
            throwsWith(ARGUMENT, "blockFloats", () -> session.poll(0, new float[floats], 1));
            throwsWith(ARGUMENT, "blockFloats", () -> session.poll(0, new float[floats], -1));
            throwsWith(ARGUMENT, "byte order", () -> session.poll(0, ByteBuffer.allocateDirect(4 * floats).order(other()).asFloatBuffer()));
            throwsWith(ARGUMENT, "read-only", () -> session.poll(0, direct(floats).asReadOnlyBuffer()));
            ByteBuffer odd = ByteBuffer.allocateDirect(4 * floats + 1).order(ByteOrder.nativeOrder());
            odd.position(1);
            FloatBuffer shifted = odd.slice().order(ByteOrder.nativeOrder()).asFloatBuffer();
            throwsWith(ARGUMENT, "aligned", () -> session.poll(0, shifted));
            throwsWith(ARGUMENT, "not direct", () -> session.pushAgentAudio(FloatBuffer.allocate(10), 24_000));
            throwsWith(ARGUMENT, "not direct", () -> VisavisEngine.fromBytes(ByteBuffer.allocate(100)));
            throwsWith(ARGUMENT, "array has 10", () -> session.pushUserAudio(new float[10], 5, 6, 24_000));
            throwsWith(ARGUMENT, "array has 10", () -> session.pushUserAudio(new float[10], -1, 6, 24_000));
            throwsWith(ARGUMENT, "array has 10", () -> session.pushUserAudio(new float[10], 5, Integer.MAX_VALUE, 24_000));
            throwsWith(NullPointerException.class, "null", () -> session.pushUserAudio(null, 0, 0, 24_000));
            throwsWith(NullPointerException.class, "null", () -> session.poll(0, (float[]) null, 0));
            throwsWith(NullPointerException.class, "null", () -> VisavisEngine.fromBytes((byte[]) null));
            // Nothing of this was computed.
            Check.equal(0L, session.stats().blocks);
            Check.equal(4, session.poll(0, direct(floats)));
        }
    }

    private static ByteOrder other() {
        return ByteOrder.nativeOrder() == ByteOrder.LITTLE_ENDIAN ? ByteOrder.BIG_ENDIAN : ByteOrder.LITTLE_ENDIAN;
    }

    static void testValues() throws Exception {
        try (VisavisEngine engine = engine();
                VisavisSession session = engine.newSession()) {
            throwsWith(ARGUMENT, "1 of 2 pushed samples", () -> session.pushUserAudio(new float[] {0, Float.NaN}, 0, 2, 24_000));
            throwsWith(ARGUMENT, "negative", () -> session.pushUserAudio(new float[2], 0, 2, -24_000));
            throwsWith(ARGUMENT, "7999", () -> session.pushUserAudio(new float[2], 0, 2, 7_999));
            throwsWith(ARGUMENT, "gaze", () -> session.setGaze(1.5f));
            throwsWith(ARGUMENT, "gaze", () -> session.setGaze(Float.NaN));
            throwsWith(ARGUMENT, "guidance", () -> session.setGuidance(21, 1));
            throwsWith(ARGUMENT, "euler", () -> session.setSampler(Sampler.euler(65)));
            throwsWith(ARGUMENT, "euler", () -> session.setSampler(Sampler.euler(-1)));
            throwsWith(ARGUMENT, "caches", () -> session.setSampler(Sampler.euler(7)));
            throwsWith(ARGUMENT, "threads", () -> engine.newSession(new SessionOptions().threads(3)));
            throwsWith(ARGUMENT, "threads", () -> engine.newSession(new SessionOptions().threads(-1)));
            throwsWith(ARGUMENT, "temperature", () -> engine.newSession(new SessionOptions().temperature(3)));
            throwsWith(ARGUMENT, "not a number", () -> new SessionOptions().gaze(Float.NaN));
            throwsWith(ARGUMENT, "budget", () -> engine.newSession(new SessionOptions().budget(1000)));
            throwsWith(ARGUMENT, "voice_ahead", () -> engine.newSession(new SessionOptions().voiceAhead(0.4)));
            throwsWith(ARGUMENT, "voice_ahead", () -> engine.newSession(new SessionOptions().voiceAhead(Double.NaN)));
            throwsWith(ARGUMENT, "budget", () -> session.setBudget(0.5f));
            throwsWith(ARGUMENT, "block time", () -> session.reportBlockTime(-1));
            throwsWith(ARGUMENT, "`dram`", () -> session.setFallback(engine));
            throwsWith(NullPointerException.class, "", () -> session.setFallback(null));
            try (VisavisEngine light = Check.light();
                    VisavisSession other = light.newSession()) {
                throwsWith(ARGUMENT, "fall back", () -> other.setFallback(light));
            }
            throwsWith(ARGUMENT, "start", () -> engine.newSession(new SessionOptions().start(0, 0, Double.NaN)));
            throwsWith(ARGUMENT, "negative", () -> session.warmUp(-1));
            throwsWith(ARGUMENT, "core mask", () -> Visavis.pinCurrentThread(0));
            session.pushUserHead(Float.NaN, 0, 0, 0);
            Check.equal(1L, session.stats().headNonFinite);
            float[] out = new float[session.layout().blockFloats()];
            session.poll(1_000_000_000L, out, 0);
            throwsWith(STATE, "backwards", () -> session.poll(999_999_999L, out, 0));
        }
    }

    static void testSounds() throws Exception {
        try (VisavisEngine engine = Check.hearing();
                VisavisEngine without = engine();
                VisavisSession session = engine.newSession();
                VisavisSession deaf = without.newSession()) {
            float[] sound = {0, Float.NaN, 65};
            throwsWith(ARGUMENT, "hearing", () -> deaf.pushSound(1, sound, 0, 1, 24_000, 0, 1, 2));
            throwsWith(ARGUMENT, "hearing", () -> deaf.endSound(1));
            throwsWith(ARGUMENT, "hearing", () -> deaf.pushEars(sound, sound, 0, 1, 24_000));
            throwsWith(ARGUMENT, "hearing", () -> deaf.endEars());
            throwsWith(ARGUMENT, "array has 3", () -> session.pushEars(new float[9], sound, 0, 9, 24_000));
            throwsWith(NullPointerException.class, "null", () -> session.pushEars(sound, null, 0, 1, 24_000));
            session.endEars();
            throwsWith(ARGUMENT, "array has 3", () -> session.heardPlace(new float[3], 1));
            throwsWith(ARGUMENT, "array has 3", () -> session.heardPlace(new float[3], -1));
            throwsWith(ARGUMENT, "array has 2", () -> deaf.heardPlace(new float[2], 0));
            throwsWith(NullPointerException.class, "null", () -> session.heardPlace(null, 0));
            throwsWith(ARGUMENT, "metres", () -> session.pushSound(1, sound, 0, 1, 24_000, Float.NaN, 1, 2));
            throwsWith(ARGUMENT, "Hz", () -> session.pushSound(1, sound, 0, 1, 0, 0, 1, 2));
            throwsWith(ARGUMENT, "negative", () -> session.pushSound(1, sound, 0, 1, -1, 0, 1, 2));
            throwsWith(ARGUMENT, "1 of 3 pushed samples", () -> session.pushSound(1, sound, 0, 3, 24_000, 0, 1, 2));
            throwsWith(ARGUMENT, "array has 3", () -> session.pushSound(1, sound, 1, 3, 24_000, 0, 1, 2));
            throwsWith(ARGUMENT, "not direct", () -> session.pushSound(1, FloatBuffer.allocate(3), 24_000, 0, 1, 2));
            throwsWith(NullPointerException.class, "null", () -> session.pushSound(1, null, 0, 0, 24_000, 0, 1, 2));
            throwsWith(ARGUMENT, "sensitivity", () -> session.setSensitivity(1.6f));
            throwsWith(ARGUMENT, "sensitivity", () -> session.setSensitivity(Float.NaN));
            throwsWith(ARGUMENT, "sensitivity", () -> engine.newSession(new SessionOptions().sensitivity(Float.NaN)));
            session.setSensitivity(-1);
            session.endSound(1);
            session.endSound(2);
            SessionStats.Sounds sounds = session.stats().sounds;
            Check.equal(1L, sounds.pieces);
            Check.equal(1L, sounds.badPlaces);
            Check.equal(1L, sounds.badRateSamples);
            Check.equal(1L, sounds.nonFiniteSamples);
            Check.equal(1L, sounds.clippedSamples);
        }
    }

    static void testClosedAndPanics() throws Exception {
        VisavisEngine engine = engine();
        VisavisSession session = engine.newSession();
        engine.close();
        engine.close();
        throwsWith(STATE, "engine is closed", engine::newSession);
        throwsWith(STATE, "engine is closed", engine::name);
        throwsWith(STATE, "engine is closed", () -> session.setFallback(engine));
        Check.equal(4, session.poll(0, new float[session.layout().blockFloats()], 0));
        session.close();
        session.close();
        float[] out = new float[session.layout().blockFloats()];
        throwsWith(STATE, "session is closed", () -> session.poll(0, out, 0));
        throwsWith(STATE, "session is closed", () -> session.pushUserHead(0, 0, 0, 0));
        throwsWith(STATE, "session is closed", session::stats);
        throwsWith(STATE, "session is closed", () -> session.heardPlace(new float[3], 0));
        throwsWith(STATE, "session is closed", session::reset);
        throwsWith(STATE, "session is closed", () -> session.pushAgentAudio(new float[1], 0, 1, 24_000));
        throwsWith(STATE, "session is closed", () -> Native.stats(-1));
        throwsWith(STATE, "engine is closed", () -> Native.engineName(Long.MAX_VALUE));
        throwsWith(VisavisException.class, "internal fault: number 42", () -> Native.panic("number 42"));
    }

    static void testNoMicrophone() {
        throwsWith(MicrophoneException.class, "go on without", VisavisMicrophone::open);
        throwsWith(MicrophoneException.class, "8000", () -> VisavisMicrophone.open(-1, 1));
        throwsWith(STATE, "microphone is closed", () -> Native.microphoneRate(1));
    }
}
