package org.visavis.demo;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.FloatBuffer;
import org.visavis.FrameLayout;
import org.visavis.MicrophoneException;
import org.visavis.Sampler;
import org.visavis.SessionStats;
import org.visavis.VisavisEngine;
import org.visavis.VisavisException;
import org.visavis.VisavisMicrophone;
import org.visavis.VisavisSession;

/**
 * A thread that runs a session in real time: feeds it the sample voices (or the microphone) and the user's place, plays the agent's voice, and keeps the
 * newest blocks for the view. It follows the voice that is heard: session time is what is heard and {@link #LEAD} more, so blocks are there when their
 * sound is. What the user interface sets is picked up before the next block.
 */
final class Motion extends Thread {
    /** A block is computed so long before its sound is heard: a block's own time at the slowest, and half as much for jitter. Seconds. */
    static final double LEAD = 0.2;
    /** Sound is given to the output so long before it is heard, for outputs with much latency of their own. */
    static final double SOUND_AHEAD = 0.5;
    /** Sound goes no further than this beyond the motion that is there: on a device that is too slow the voice waits for the body. */
    private static final double VOICE_AHEAD = 0.4;
    /** Milliseconds that the governor may use of each block's 133. */
    private static final float BUDGET = 100;
    private static final long TICK = 10;

    private final Life life;
    private final MicrophoneState microphoneState;
    private final Wav agent;
    private final Wav user;
    private final VisavisSession session;
    private final VoiceClock clock = new VoiceClock(-LEAD);
    private final FrameQueue frames;
    private final BlockTimes times = new BlockTimes(120);
    private final FloatBuffer block;
    private final float[] sound;

    private VisavisMicrophone microphone;
    private Speaker speaker;
    private long fed;
    private int gazeNow;
    private float volumeNow = 1;

    private volatile boolean running = true;
    private volatile int gazeStep;
    private volatile Sampler sampler = Sampler.MIDPOINT4;
    private volatile float userX;
    private volatile float userZ = 1.5f;
    private volatile String note = "";
    private volatile SessionStats stats;

    /** Makes the session and warms it up, which takes as long as a few blocks. */
    Motion(VisavisEngine engine, Wav agent, Wav user, Life life, MicrophoneState microphoneState) {
        super("visavis-motion");
        this.agent = agent;
        this.user = user;
        this.life = life;
        this.microphoneState = microphoneState;
        session = engine.newSession();
        session.setBudget(BUDGET);
        session.warmUp();
        frames = new FrameQueue(session.layout());
        block = ByteBuffer.allocateDirect(4 * session.layout().blockFloats()).order(ByteOrder.nativeOrder()).asFloatBuffer();
        sound = new float[Math.max(agent.rate, user.rate) * FrameLayout.FRAMES / 30 + 1];
    }

    void finish() {
        running = false;
        interrupt();
    }

    /** 0: what comes naturally; 1 to 101: a gaze target of 0 to 100 percent. */
    void setGazeStep(int step) {
        gazeStep = step;
    }

    int gazeStep() {
        return gazeStep;
    }

    void setSampler(Sampler sampler) {
        this.sampler = sampler;
    }

    Sampler sampler() {
        return sampler;
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

    /** What the user should know about the sound; empty when there is nothing. */
    String note() {
        return note;
    }

    FrameQueue frames() {
        return frames;
    }

    BlockTimes times() {
        return times;
    }

    /** Instead of a start: lets go of the session. */
    void discard() {
        session.close();
    }

    VoiceClock clock() {
        return clock;
    }

    /** Null before the first block. */
    SessionStats stats() {
        return stats;
    }

    @Override
    public void run() {
        try {
            while (running) {
                if (life.runs()) {
                    converse();
                } else {
                    life.await(1000);
                }
            }
        } catch (InterruptedException e) {
            // Asked to finish.
        } catch (RuntimeException | Error e) {
            life.failed(Failure.of("computing the motion", e));
        } finally {
            closeMicrophone();
            if (speaker != null) {
                speaker.close();
            }
            session.close();
        }
    }

    /** From a start or a pause to the next pause. */
    private void converse() throws InterruptedException {
        long now = System.nanoTime();
        if (speaker == null) {
            speaker = speaker(now);
        }
        if (speaker == null) {
            clock.start(now, false);
        } else {
            speaker.play(now);
        }
        try {
            while (running && life.runs()) {
                now = System.nanoTime();
                double heard = clock.heard(now);
                keepSpeaker(now, heard);
                keepMicrophone(now);
                if (session.nextDueNanos() * 1e-9 <= heard + LEAD) {
                    step();
                } else {
                    Thread.sleep(TICK);
                }
            }
        } finally {
            now = System.nanoTime();
            closeMicrophone();
            microphoneState.suspended(now);
            if (speaker != null) {
                speaker.pause(now);
            } else {
                clock.pause(now);
            }
        }
    }

    private void step() {
        long due = session.nextDueNanos();
        session.pushAgentAudio(sound, 0, part(agent), agent.rate);
        if (microphone != null) {
            microphone.pump(session);
        } else {
            session.pushUserAudio(sound, 0, part(user), user.rate);
        }
        fed++;
        session.pushUserHead(userX, Projection.HEAD, userZ, due);
        int gaze = gazeStep;
        if (gaze != gazeNow) {
            if (gaze == 0) {
                session.setNaturalGaze();
            } else {
                session.setGaze((gaze - 1) / 100f);
            }
            gazeNow = gaze;
        }
        if (!session.sampler().equals(sampler)) {
            session.setSampler(sampler);
        }
        long before = System.nanoTime();
        if (session.poll(due, block) == FrameLayout.FRAMES) {
            times.add((System.nanoTime() - before) / 1e6f);
            frames.add(block);
            stats = session.stats();
        }
    }

    private void keepSpeaker(long now, double heard) {
        if (speaker == null) {
            return;
        }
        if (volumeNow != life.volume()) {
            volumeNow = life.volume();
            speaker.volume(volumeNow);
        }
        speaker.watch(now);
        if (!speaker.fill(Math.min(heard + SOUND_AHEAD, frames.end() + VOICE_AHEAD))) {
            // Unplugged, or the audio server has restarted: another track goes on from what was heard.
            speaker.close();
            clock.pause(now);
            speaker = speaker(now);
            if (speaker == null) {
                clock.start(now, false);
            } else {
                speaker.play(now);
            }
        }
    }

    /** The agent's voice is heard where the device has an output for it; motion goes on without. */
    private Speaker speaker(long now) {
        try {
            Speaker made = new Speaker(agent, clock, clock.heard(now), SOUND_AHEAD);
            note = "";
            volumeNow = 1;
            return made;
        } catch (IllegalArgumentException | IllegalStateException | UnsupportedOperationException e) {
            note = "No sound: " + e.getMessage() + ". The motion goes on without.";
            return null;
        }
    }

    private void keepMicrophone(long now) {
        if (microphone != null && (!microphoneState.wanted() || microphoneState.lost(microphone.captured(), microphone.ended(), now))) {
            closeMicrophone();
        }
        if (microphone == null && microphoneState.due(now)) {
            try {
                microphone = VisavisMicrophone.open();
                microphoneState.opened(now);
            } catch (MicrophoneException | VisavisException e) {
                microphoneState.failed(String.valueOf(e.getMessage()), now);
            }
        }
    }

    private void closeMicrophone() {
        if (microphone != null) {
            microphone.close();
            microphone = null;
        }
    }

    /** Copies the next block's part of a voice; a block is no whole number of samples at every rate, so parts differ by one. Returns their number. */
    private int part(Wav wav) {
        long from = fed * wav.rate * FrameLayout.FRAMES / 30;
        int count = (int) ((fed + 1) * wav.rate * FrameLayout.FRAMES / 30 - from);
        wav.copy(from, sound, count);
        return count;
    }
}
