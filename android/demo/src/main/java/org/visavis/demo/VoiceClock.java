package org.visavis.demo;

/**
 * What is heard now, in session seconds: the one clock that voice and motion follow. It runs with the system's clock and is drawn to the audio output's
 * time stamps, which know the output's latency; it never runs backwards, and never beyond the sound that the output was given, so that motion waits
 * when sound is late. After a start or a pause it stands still until the first time stamp of what came since.
 */
final class VoiceClock {
    /** Without a time stamp for so long the output is believed to have none, seconds. */
    static final double PATIENCE = 0.4;
    private static final double JUMP = 0.1;
    private static final double WEIGHT = 0.25;

    private double base;
    private long since;
    private double given = Double.POSITIVE_INFINITY;
    private double last;
    private boolean running;
    private boolean waiting;
    private long started;

    /** @param from session second at which it stands before it is started; negative while a silence comes first */
    VoiceClock(double from) {
        base = from;
        last = from;
    }

    /** Runs from here on; with an output it waits for its first time stamp. */
    synchronized void start(long now, boolean output) {
        base = last;
        since = now;
        started = now;
        running = true;
        waiting = output;
        if (!output) {
            given = Double.POSITIVE_INFINITY;
        }
    }

    synchronized void pause(long now) {
        heard(now);
        base = last;
        running = false;
        waiting = false;
    }

    /** The output has the sound up to this session second. */
    synchronized void given(double until) {
        given = until;
    }

    /** By the output's own account this session second was heard at {@code at}. */
    synchronized void stamp(double second, long at, long now) {
        if (!running || at < started) {
            return; // of before a pause
        }
        double told = second + (now - at) * 1e-9;
        if (waiting) {
            waiting = false;
            base = told;
            since = now;
            return;
        }
        double mine = base + (now - since) * 1e-9;
        double error = told - mine;
        base = mine + (Math.abs(error) > JUMP ? error : WEIGHT * error);
        since = now;
    }

    /** Session second that is heard at {@code now} (System.nanoTime). */
    synchronized double heard(long now) {
        if (running && waiting && (now - started) * 1e-9 > PATIENCE) {
            waiting = false;
            since = now;
        }
        if (running && !waiting) {
            last = Math.max(last, Math.min(given, base + (now - since) * 1e-9));
        }
        return last;
    }

    /** What will be heard a moment after {@code now}, for a picture that is seen then. */
    synchronized double heardSoon(long now, double seconds) {
        double heard = heard(now);
        return running && !waiting ? Math.min(given, heard + seconds) : heard;
    }
}
