package org.visavis;

import java.nio.FloatBuffer;

/** A synthetic conversation in whole-number arithmetic: the same bits on every machine. */
final class Conversation {
    private Conversation() {}

    /** A voice that speaks every other second: a triangle wave, louder and softer. */
    static FloatBuffer voice(int rate, int samples, int hertz, int turn) {
        FloatBuffer voice = Check.direct(samples);
        for (int i = 0; i < samples; i++) {
            boolean speaks = (i / rate + turn) % 2 == 0;
            int phase = (int) ((long) i * hertz % rate);
            int wave = Math.abs(4 * phase - 2 * rate) - rate;
            int level = (i / (rate / 8)) % 4;
            voice.put(i, speaks ? 0.05f * level * wave / rate : 0);
        }
        return voice;
    }

    /** Pushes {@code seconds} of both voices and of the head of a user who walks to and fro. */
    static void push(VisavisSession session, int seconds, int rate) {
        session.pushAgentAudio(voice(rate, seconds * rate, 120, 0), rate);
        session.pushUserAudio(voice(rate, seconds * rate, 190, 1), rate);
        walk(session, 0, 60 * seconds);
        walk(session, 1, 60 * seconds);
    }

    /** Every second position of the first {@code count} of that walk, from {@code first} on. */
    static void walk(VisavisSession session, int first, int count) {
        for (int i = first; i < count; i += 2) {
            float x = (Math.abs(i % 240 - 120) - 60) / 60f;
            session.pushUserHead(x, 1.65f, 1.5f, i * 16_666_667L);
        }
    }
}
