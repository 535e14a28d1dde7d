package org.visavis.demo;

import java.util.Arrays;
import java.util.Locale;
import org.visavis.Sampler;
import org.visavis.SessionOptions;
import org.visavis.VisavisEngine;
import org.visavis.VisavisSession;

/** Block times of each sampler with one and two threads, as fast as they go. */
final class Bench {
    private Bench() {}

    interface Output {
        void line(String text);
    }

    static void run(VisavisEngine engine, Wav agent, Wav user, int blocks, Output output) {
        output.line("sampler      threads   p50 ms   p95 ms   p99 ms   max ms   frames/s   x real time");
        for (Sampler sampler : new Sampler[] {Sampler.MIDPOINT4, Sampler.MIDPOINT2, Sampler.MIDPOINT1, Sampler.SINGLE}) {
            for (int threads = 1; threads <= 2; threads++) {
                if (!sampler.equals(Sampler.SINGLE) || engine.hasStudent()) {
                    output.line(measure(engine, agent, user, blocks, sampler, threads));
                }
            }
        }
    }

    private static String measure(VisavisEngine engine, Wav agent, Wav user, int blocks, Sampler sampler, int threads) {
        double[] ms = new double[blocks];
        try (VisavisSession session = engine.newSession(new SessionOptions().sampler(sampler).threads(threads).gaze(0.8f))) {
            session.warmUp();
            session.pushAgentAudio(agent.samples, agent.rate);
            session.pushUserAudio(user.samples, user.rate);
            float[] out = new float[session.layout().blockFloats()];
            for (int k = 0; k < blocks; k++) {
                long due = session.nextDueNanos();
                session.pushUserHead((float) Math.sin(k * 0.05), 1.65f, 1.5f, due);
                long before = System.nanoTime();
                session.poll(due, out, 0);
                ms[k] = (System.nanoTime() - before) / 1e6;
            }
        }
        double mean = Arrays.stream(ms).average().orElse(0);
        Arrays.sort(ms);
        return String.format(Locale.ROOT, "%-12s %7d %8.2f %8.2f %8.2f %8.2f %10.0f %13.1f", sampler, threads, rank(ms, 0.5), rank(ms, 0.95),
                rank(ms, 0.99), rank(ms, 1), 4000 / mean, 4000 / mean / 30);
    }

    private static double rank(double[] sorted, double p) {
        return sorted[Math.max(1, Math.min(sorted.length, (int) Math.ceil(p * sorted.length))) - 1];
    }
}
