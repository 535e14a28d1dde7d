package org.visavis.demo;

import org.visavis.Sampler;
import org.visavis.VisavisEngine;

/** Everything that is measured, on a thread of its own while the conversation stands: block times first, then minutes of real time. */
final class Measurement extends Thread {
    /** Blocks of a row: half a minute of motion. */
    static final int BLOCKS = 225;

    private final VisavisEngine engine;
    private final Wav agent;
    private final Wav user;
    private final int minutes;
    private final Heat heat;
    private final Life life;
    private final int blocks;
    private final double minute;
    private final BlockTimes times = new BlockTimes(450);
    private final StringBuffer report = new StringBuffer();
    private volatile float fraction;
    private volatile String doing = "Starting";
    private volatile String cancelled;

    Measurement(VisavisEngine engine, Wav agent, Wav user, int minutes, Heat heat, Life life) {
        this(engine, agent, user, minutes, heat, life, BLOCKS, 60);
    }

    /** With rows of other lengths. */
    Measurement(VisavisEngine engine, Wav agent, Wav user, int minutes, Heat heat, Life life, int blocks, double minute) {
        super("visavis-measure");
        this.engine = engine;
        this.agent = agent;
        this.user = user;
        this.minutes = minutes;
        this.heat = heat;
        this.life = life;
        this.blocks = blocks;
        this.minute = minute;
    }

    /** Ends it; the report keeps what there is and says why. */
    void cancel(String why) {
        if (isAlive() || getState() == State.NEW) {
            cancelled = why;
            interrupt();
        }
    }

    /** Lines so far. */
    String report() {
        return report.toString();
    }

    /** What is under way; empty at the end. */
    String doing() {
        return doing;
    }

    /** 0 to 1. */
    float fraction() {
        return fraction;
    }

    BlockTimes times() {
        return times;
    }

    @Override
    public void run() {
        life.measuring(true);
        try {
            table();
            conversation();
            line(cancelled == null ? "" : "stopped: " + cancelled);
        } catch (InterruptedException e) {
            line("stopped: " + (cancelled == null ? "interrupted" : cancelled));
        } catch (RuntimeException | Error e) {
            line(Failure.of("measuring", e).toString());
        } finally {
            fraction = 1;
            doing = "";
            life.measuring(false);
        }
    }

    private void table() throws InterruptedException {
        line("Block times in ms, as fast as they go; deadline 133:");
        line(Bench.HEAD);
        Sampler[] samplers = Bench.samplers(engine);
        for (int i = 0; i < samplers.length; i++) {
            for (int threads = 1; threads <= 2; threads++) {
                doing = samplers[i] + " with " + threads + (threads == 1 ? " thread" : " threads");
                line(Bench.row(engine, agent, user, blocks, samplers[i], threads, times));
                fraction = (2 * i + threads) / (2f * samplers.length) * (minutes > 0 ? 0.15f : 1);
            }
        }
    }

    private void conversation() throws InterruptedException {
        if (minutes <= 0) {
            return;
        }
        line("");
        line("In real time, with the governor, budget 100 ms per block:");
        line(HeatRun.HEAD);
        HeatRun run = new HeatRun(engine, agent, user, heat, times);
        try {
            for (int i = 1; i <= minutes; i++) {
                doing = "Real time, minute " + i + " of " + minutes;
                line(run.minute(i, minute));
                fraction = 0.15f + 0.85f * i / minutes;
            }
        } finally {
            run.close();
        }
    }

    private void line(String text) {
        report.append(text).append('\n');
    }
}
