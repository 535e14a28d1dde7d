package org.visavis;

import static org.visavis.Check.blocks;
import static org.visavis.Check.engine;

/** Prints digests of motion, for whoever compares machines. */
final class DigestTest {
    private DigestTest() {}

    static void testDigests() throws Exception {
        try (VisavisEngine engine = engine()) {
            print(engine, "midpoint4", new SessionOptions().gaze(0.8f), 48_000);
            print(engine, "threads", new SessionOptions().threads(2).seed(7), 24_000);
            if (engine.hasStudent()) {
                print(engine, "single", new SessionOptions().sampler(Sampler.SINGLE), 16_000);
            }
        }
    }

    /** FNV-1a over the bits of all floats. */
    private static void print(VisavisEngine engine, String name, SessionOptions options, int rate) {
        try (VisavisSession session = engine.newSession(options)) {
            Conversation.push(session, 2, rate);
            float[] out = new float[session.layout().blockFloats()];
            long digest = 0xcbf29ce484222325L;
            for (int k = 0; k < blocks; k++) {
                session.poll(session.nextDueNanos(), out, 0);
                for (float v : out) {
                    digest = (digest ^ Float.floatToRawIntBits(v)) * 0x100000001b3L;
                }
            }
            System.out.println("digest " + name + " " + Long.toHexString(digest));
        }
    }
}
