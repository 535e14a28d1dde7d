package org.visavis.demo;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.FloatBuffer;
import org.visavis.FrameLayout;
import org.visavis.MicrophoneException;
import org.visavis.Sampler;
import org.visavis.SessionStats;
import org.visavis.VisavisEngine;
import org.visavis.VisavisMicrophone;
import org.visavis.VisavisSession;

/**
 * A thread that runs a session in real time: feeds it the sample voices (or the microphone) and the user's place, and keeps the newest block
 * for the view. What the user interface sets is picked up before the next block.
 */
final class Motion extends Thread {
    private static final int TIMES = 120;

    private final VisavisEngine engine;
    private final Wav agent;
    private final Wav user;
    private final FloatBuffer frames;
    private final float[] shown;
    private final float[] blockMs = new float[TIMES];
    private int blocks;
    private SessionStats stats;

    private volatile boolean running = true;
    private volatile boolean listen;
    private volatile float gaze = Float.NaN;
    private volatile Sampler sampler = Sampler.MIDPOINT4;
    private volatile float userX;
    private volatile float userZ = 1.5f;
    private volatile String note = "";

    Motion(VisavisEngine engine, Wav agent, Wav user) {
        super("visavis-motion");
        this.engine = engine;
        this.agent = agent;
        this.user = user;
        try (VisavisSession probe = engine.newSession()) {
            frames = ByteBuffer.allocateDirect(4 * probe.layout().blockFloats()).order(ByteOrder.nativeOrder()).asFloatBuffer();
        }
        shown = new float[frames.capacity()];
    }

    void finish() {
        running = false;
        interrupt();
    }

    void setGaze(float target) {
        gaze = target;
    }

    void setSampler(Sampler sampler) {
        this.sampler = sampler;
    }

    void setListening(boolean listen) {
        this.listen = listen;
    }

    void moveUser(float x, float z) {
        userX = x;
        userZ = z;
    }

    float userX() {
        return userX;
    }

    float userZ() {
        return userZ;
    }

    String note() {
        return note;
    }

    /** Copies the newest block into {@code into} (of {@link #floats()}) and the block times, newest last; returns how many blocks there are. */
    synchronized int snapshot(float[] into, float[] times) {
        System.arraycopy(shown, 0, into, 0, shown.length);
        for (int i = 0; i < TIMES; i++) {
            times[i] = blockMs[(blocks + i) % TIMES];
        }
        return blocks;
    }

    synchronized SessionStats stats() {
        return stats;
    }

    int floats() {
        return shown.length;
    }

    static int times() {
        return TIMES;
    }

    @Override
    public void run() {
        try (VisavisSession session = engine.newSession()) {
            session.warmUp();
            converse(session);
        } catch (InterruptedException e) {
            // Asked to finish.
        } catch (RuntimeException e) {
            note = String.valueOf(e.getMessage());
        }
    }

    private void converse(VisavisSession session) throws InterruptedException {
        VisavisMicrophone microphone = null;
        Speaker speaker = speaker();
        boolean tried = false;
        int fed = 0;
        float gazeNow = Float.NaN;
        try {
            while (running) {
                long due = session.nextDueNanos();
                long wait = due - session.sessionTimeNanos();
                if (wait > 0) {
                    Thread.sleep(wait / 1_000_000, (int) (wait % 1_000_000));
                }
                if (listen && microphone == null && !tried) {
                    tried = true;
                    microphone = open();
                }
                FloatBuffer voice = part(agent, fed);
                session.pushAgentAudio(voice, agent.rate);
                if (speaker != null) {
                    speaker.play(voice);
                }
                if (microphone != null) {
                    microphone.pump(session);
                } else {
                    session.pushUserAudio(part(user, fed), user.rate);
                }
                fed++;
                session.pushUserHead(userX, 1.65f, userZ, due);
                float target = gaze;
                if (Float.compare(target, gazeNow) != 0) {
                    if (Float.isNaN(target)) {
                        session.setNaturalGaze();
                    } else {
                        session.setGaze(target);
                    }
                    gazeNow = target;
                }
                if (!session.sampler().equals(sampler)) {
                    session.setSampler(sampler);
                }
                long before = System.nanoTime();
                if (session.poll(frames) == FrameLayout.FRAMES) {
                    keep((System.nanoTime() - before) / 1e6f, session.stats());
                }
            }
        } finally {
            if (microphone != null) {
                microphone.close();
            }
            if (speaker != null) {
                speaker.close();
            }
        }
    }

    /** The agent's voice is heard where the device has an output for it; motion goes on without. */
    private Speaker speaker() {
        try {
            return new Speaker(agent.rate, samples(agent));
        } catch (IllegalArgumentException | UnsupportedOperationException e) {
            note = String.valueOf(e.getMessage());
            return null;
        }
    }

    private VisavisMicrophone open() {
        try {
            return VisavisMicrophone.open();
        } catch (MicrophoneException e) {
            note = e.getMessage();
            return null;
        }
    }

    private synchronized void keep(float ms, SessionStats now) {
        frames.duplicate().get(shown);
        blockMs[blocks % TIMES] = ms;
        blocks++;
        stats = now;
    }

    /** Samples of a block. */
    private static int samples(Wav wav) {
        return wav.rate * FrameLayout.FRAMES / 30;
    }

    /** The voice of block {@code block}, over and over. */
    private static FloatBuffer part(Wav wav, int block) {
        int count = samples(wav);
        int from = (int) ((long) block * count % Math.max(1, wav.samples.capacity() - count));
        FloatBuffer part = wav.samples.duplicate();
        part.position(from).limit(Math.min(from + count, part.capacity()));
        return part;
    }
}
