package org.visavis.demo;

import java.util.Arrays;
import java.util.Locale;
import org.visavis.Sampler;
import org.visavis.SessionOptions;
import org.visavis.VisavisEngine;
import org.visavis.VisavisSession;

/** Block times of each sampler with one and two threads, as fast as they go. */
final class Bench {
    private static final String ROW = "%-10s %7s %6s %6s %6s %6s %12s";
    /** Above the rows; times are milliseconds. */
    static final String HEAD = String.format(Locale.ROOT, ROW, "sampler", "threads", "p50", "p95", "p99", "max", "x real time");
    static final Sampler[] SAMPLERS = {Sampler.MIDPOINT4, Sampler.MIDPOINT2, Sampler.MIDPOINT1, Sampler.SINGLE};

    private Bench() {}

    /** Those of {@link #SAMPLERS} that the bundle can do. */
    static Sampler[] samplers(VisavisEngine engine) {
        return engine.hasStudent() ? SAMPLERS : Arrays.copyOf(SAMPLERS, SAMPLERS.length - 1);
    }

    /** One row; blocks that are computed show in {@code progress}. */
    static String row(VisavisEngine engine, Wav agent, Wav user, int blocks, Sampler sampler, int threads, BlockTimes progress)
            throws InterruptedException {
        float[] ms = new float[blocks];
        try (VisavisSession session = engine.newSession(new SessionOptions().sampler(sampler).threads(threads).gaze(0.8f))) {
            session.warmUp();
            push(session, agent, user, blocks);
            float[] out = new float[session.layout().blockFloats()];
            for (int k = 0; k < blocks; k++) {
                if (Thread.interrupted()) {
                    throw new InterruptedException();
                }
                long due = session.nextDueNanos();
                session.pushUserHead((float) Math.sin(k * 0.05), Projection.HEAD, 1.5f, due);
                long before = System.nanoTime();
                session.poll(due, out, 0);
                ms[k] = (System.nanoTime() - before) / 1e6f;
                progress.add(ms[k]);
            }
        }
        return format(sampler, threads, ms);
    }

    /** All the sound that the blocks need. */
    private static void push(VisavisSession session, Wav agent, Wav user, int blocks) {
        for (Wav voice : new Wav[] {agent, user}) {
            float[] sound = new float[(int) (blocks * BlockTimes.DEADLINE / 1000 * voice.rate) + 1];
            voice.copy(0, sound, sound.length);
            if (voice == agent) {
                session.pushAgentAudio(sound, 0, sound.length, voice.rate);
            } else {
                session.pushUserAudio(sound, 0, sound.length, voice.rate);
            }
        }
    }

    static String format(Sampler sampler, int threads, float[] ms) {
        float sum = 0;
        for (float one : ms) {
            sum += one;
        }
        float mean = Math.max(1e-3f, sum / Math.max(1, ms.length));
        float[] sorted = ms.clone();
        Arrays.sort(sorted);
        return String.format(Locale.ROOT, ROW, sampler, threads, one(BlockTimes.rank(sorted, 0.5)), one(BlockTimes.rank(sorted, 0.95)),
                one(BlockTimes.rank(sorted, 0.99)), one(BlockTimes.rank(sorted, 1)), one(BlockTimes.DEADLINE / mean));
    }

    /** With one decimal. */
    static String one(float value) {
        return String.format(Locale.ROOT, "%.1f", value);
    }
}
