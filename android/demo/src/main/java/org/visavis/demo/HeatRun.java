package org.visavis.demo;

import java.util.Arrays;
import java.util.Locale;
import org.visavis.FrameLayout;
import org.visavis.SessionOptions;
import org.visavis.SessionStats;
import org.visavis.VisavisEngine;
import org.visavis.VisavisSession;

/** A conversation in real time, minute by minute: block times, what the governor made of them, and how hot the device became. */
final class HeatRun {
    private static final String ROW = "%6s %6s %6s %6s %5s %6s %5s %4s %5s   %s";
    /** Above the rows; times are milliseconds. */
    static final String HEAD = String.format(Locale.ROOT, ROW, "minute", "p50", "p95", "max", "late", "evals", "down", "up", "held", "heat");
    private static final float BUDGET = 100;

    private final VisavisSession session;
    private final Wav agent;
    private final Wav user;
    private final Heat heat;
    private final BlockTimes progress;
    private final float[] out;
    private final float[] sound;
    private long block;

    /** Of an engine's session with a budget of 100 ms; close it. */
    HeatRun(VisavisEngine engine, Wav agent, Wav user, Heat heat, BlockTimes progress) {
        session = engine.newSession(new SessionOptions().budget(BUDGET));
        this.agent = agent;
        this.user = user;
        this.heat = heat;
        this.progress = progress;
        out = new float[session.layout().blockFloats()];
        sound = new float[Math.max(agent.rate, user.rate) * FrameLayout.FRAMES / 30 + 1];
        session.warmUp();
    }

    /** Runs for so long and returns the row of this time. */
    String minute(int number, double seconds) throws InterruptedException {
        int blocks = (int) Math.max(1, Math.round(seconds * 30 / FrameLayout.FRAMES));
        float[] ms = new float[blocks];
        float evaluations = 0;
        int late = 0;
        SessionStats before = session.stats();
        for (int k = 0; k < blocks; k++) {
            long due = session.nextDueNanos();
            long wait = due - session.sessionTimeNanos();
            if (wait > 0) {
                Thread.sleep(wait / 1_000_000, (int) (wait % 1_000_000));
            } else if (Thread.interrupted()) {
                throw new InterruptedException();
            }
            session.pushAgentAudio(sound, 0, part(agent), agent.rate);
            session.pushUserAudio(sound, 0, part(user), user.rate);
            session.pushUserHead((float) Math.sin(block * 0.05), Projection.HEAD, 1.5f, due);
            long start = System.nanoTime();
            session.poll(due, out, 0);
            ms[k] = (System.nanoTime() - start) / 1e6f;
            progress.add(ms[k]);
            evaluations += out[FrameLayout.EVALUATIONS];
            // The block's motion ends when the next one is due.
            late += session.sessionTimeNanos() > session.nextDueNanos() ? 1 : 0;
            block++;
        }
        return format(number, ms, late, evaluations / blocks, before, session.stats(), heat);
    }

    private int part(Wav wav) {
        long from = block * wav.rate * FrameLayout.FRAMES / 30;
        int count = (int) ((block + 1) * wav.rate * FrameLayout.FRAMES / 30 - from);
        wav.copy(from, sound, count);
        return count;
    }

    private static String format(int number, float[] ms, int late, float evaluations, SessionStats before, SessionStats after, Heat heat) {
        float[] sorted = ms.clone();
        Arrays.sort(sorted);
        float battery = heat.battery();
        String degrees = Float.isNaN(battery) ? "" : String.format(Locale.ROOT, ", %.1f C", battery);
        return String.format(Locale.ROOT, ROW, number, Bench.one(BlockTimes.rank(sorted, 0.5)), Bench.one(BlockTimes.rank(sorted, 0.95)),
                Bench.one(BlockTimes.rank(sorted, 1)), late, Bench.one(evaluations), after.governorDown - before.governorDown,
                after.governorUp - before.governorUp, after.governorHeldBlocks - before.governorHeldBlocks, heat.status() + degrees);
    }

    void close() {
        session.close();
    }
}
