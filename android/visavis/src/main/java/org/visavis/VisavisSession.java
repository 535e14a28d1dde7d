package org.visavis;

import androidx.annotation.NonNull;
import java.nio.ByteOrder;
import java.nio.FloatBuffer;

/**
 * One conversation with one user.
 *
 * <p>Any thread may call. Pushes, commands to a voice, and settings (the methods push, finish, clear, end, set and report, but for
 * setFallback) never wait, neither for a
 * block that another thread computes nor for each other; a block goes by what came before its poll began, and the same inputs give the same
 * motion, whichever threads they come from. A voice is one stream, and so is a sound source: one thread pushes its sound, while commands may come from others. All
 * other calls take turns, and so may wait for a block's time.
 *
 * <p>Times are nanoseconds of session time: 0 when the session is made or reset. {@link #sessionTimeNanos()} is a clock of that kind; a
 * program that replays a recording, or has a clock of its own, passes times itself. Audio has no times: each voice is one
 * continuous stream that starts at 0.
 *
 * <p>Buffers are direct and in native byte order, {@code ByteBuffer.allocateDirect(4 * n).order(ByteOrder.nativeOrder()).asFloatBuffer()};
 * their position and limit are heeded and left as they are. Each method has a variant for arrays, which copies.
 */
public final class VisavisSession implements AutoCloseable {
    private static final int AGENT = 0;
    private static final int USER = 1;

    private final long handle;
    private final FrameLayout layout;
    private volatile long start = System.nanoTime();

    VisavisSession(long handle, Skeleton skeleton) {
        this.handle = handle;
        this.layout = new FrameLayout(skeleton.size());
    }

    /**
     * Appends to the agent's own voice: mono samples, full scale 1, up to a minute ahead of time
     * ({@link SessionOptions#voiceAhead}; more is dropped and counted).
     * Sound that has not come when a block is computed is silence there, is counted, and is heard later.
     *
     * @param rate samples a second, 8000 to 192000
     * @throws IllegalArgumentException for a rate out of range or a buffer that is not direct (nothing is taken), or samples that are not
     *     finite (they become silence, all others are taken); samples that were not taken as they were are counted
     * @throws IllegalStateException when this session is closed
     */
    public void pushAgentAudio(@NonNull FloatBuffer samples, int rate) {
        push(AGENT, samples, rate);
    }

    /** As {@link #pushAgentAudio(FloatBuffer, int)}, from a part of an array. */
    public void pushAgentAudio(@NonNull float[] samples, int offset, int count, int rate) {
        Native.pushArray(handle, AGENT, samples, offset, count, rate);
    }

    /** Appends to the user's voice, as {@link #pushAgentAudio(FloatBuffer, int)}. */
    public void pushUserAudio(@NonNull FloatBuffer samples, int rate) {
        push(USER, samples, rate);
    }

    /** As {@link #pushUserAudio(FloatBuffer, int)}, from a part of an array. */
    public void pushUserAudio(@NonNull float[] samples, int offset, int count, int rate) {
        Native.pushArray(handle, USER, samples, offset, count, rate);
    }

    /** Ends an utterance of the agent: the last milliseconds, which wait in the resampler, come out. Optional. */
    public void finishAgentAudio() {
        Native.finishVoice(handle, AGENT);
    }

    /** The same for the user. */
    public void finishUserAudio() {
        Native.finishVoice(handle, USER);
    }

    /** Drops all sound of the user that has not been used. */
    public void clearUserAudio() {
        Native.clearVoice(handle, USER);
    }

    /** Drops all sound of the agent that has not been used, as when it is interrupted. */
    public void clearAgentAudio() {
        Native.clearVoice(handle, AGENT);
    }

    /**
     * Appends to what a sound source in the room gives off: mono samples, pascals as they are 1 m from it (RMS 1 is 94 dB SPL). The first piece of a
     * source, and the first after it ran dry, sounds from the next block on; further pieces follow it without a gap, up to ten seconds ahead (more is
     * dropped and counted). No samples move a source that sounds. Sixteen sources sound at once: one more takes the place of the quietest at the agent's
     * head, if it is louder. One thread pushes a source's sound.
     *
     * @param id the source, any number
     * @param rate samples a second, 8000 to 192000
     * @param x where the source is from now on, world metres
     * @throws IllegalArgumentException where the bundle has no hearing ({@link VisavisEngine#hasHearing}), for a rate out of range or a buffer that is
     *     not direct (nothing is taken), a place that is not finite (sound of a source that has a place is taken), or samples that are not finite (they
     *     become silence, all others are taken)
     * @throws IllegalStateException when this session is closed
     */
    public void pushSound(int id, @NonNull FloatBuffer samples, int rate, float x, float y, float z) {
        checked(samples);
        Native.pushSoundBuffer(handle, id, samples, samples.position(), samples.remaining(), rate, x, y, z);
    }

    /** As {@link #pushSound(int, FloatBuffer, int, float, float, float)}, from a part of an array. */
    public void pushSound(int id, @NonNull float[] samples, int offset, int count, int rate, float x, float y, float z) {
        Native.pushSoundArray(handle, id, samples, offset, count, rate, x, y, z);
    }

    /**
     * Ends a sound source at once: what no block has heard of it is dropped. Without effect where it does not sound.
     *
     * @throws IllegalArgumentException where the bundle has no hearing
     */
    public void endSound(int id) {
        Native.endSound(handle, id);
    }

    /**
     * Appends to what two microphones at the agent's ears hear, pascals: for hosts that do not know where sounds are. The direction is estimated as the
     * agent's head turns. The first piece is heard from the next block on, further ones follow it, up to ten seconds ahead (more is dropped and counted).
     * One thread at a time.
     *
     * @param count samples of each, from offset on
     * @param rate samples a second, 8000 to 192000
     * @throws IllegalArgumentException where the bundle has no hearing ({@link VisavisEngine#hasHearing}) or for a rate out of range (nothing is taken),
     *     or samples that are not finite (they become silence, all others are taken)
     * @throws IllegalStateException when this session is closed
     */
    public void pushEars(@NonNull float[] left, @NonNull float[] right, int offset, int count, int rate) {
        Native.pushEars(handle, left, right, offset, count, rate);
    }

    /**
     * Ends what the ears brought at once: what no block has heard of it is dropped.
     *
     * @throws IllegalArgumentException where the bundle has no hearing
     */
    public void endEars() {
        Native.endEars(handle);
    }

    /**
     * Writes where the last block took what stands out among the sounds to be, x, y, z in world metres: the place of a source, or, of what
     * {@link #pushEars} brought, the direction that was estimated, 2 m away and 1.5 m over the floor. It stays known for two seconds after the sound
     * has faded.
     *
     * @return whether a place is known and was written; false, and {@code out} as it was, before any sound, once it is forgotten, and where the bundle has
     *     no hearing
     * @throws IllegalArgumentException when there is no room for three floats from {@code offset} on
     * @throws IllegalStateException when this session is closed
     */
    public boolean heardPlace(@NonNull float[] out, int offset) {
        return Native.heardPlace(handle, out, offset);
    }

    /**
     * Sets how much the agent minds sounds in the room from the next block on: -1 dull, 0 neutral, 1 sensitive, numbers between and up to 1.5 either way.
     *
     * @throws IllegalArgumentException outside -1.5 to 1.5
     */
    public void setSensitivity(float sensitivity) {
        Native.setSensitivity(handle, sensitivity);
    }

    /** Makes the agent's voice present (silent until something is pushed) or absent (until the next push). */
    public void setAgentAudioPresent(boolean present) {
        Native.setVoicePresent(handle, AGENT, present);
    }

    /** The same for the user's voice, as when a microphone is muted. */
    public void setUserAudioPresent(boolean present) {
        Native.setVoicePresent(handle, USER, present);
    }

    /**
     * Tells where the user's head is (midpoint of the eyes), world metres. Any rate; positions are put in order by time. Those that are late,
     * not finite or impossible are ignored and counted.
     */
    public void pushUserHead(float x, float y, float z, long timeNanos) {
        Native.pushHead(handle, x, y, z, timeNanos * 1e-9);
    }

    /**
     * As {@link #pushUserHead(float, float, float, long)}, with the head's rotation: a quaternion of about unit length in the world, identity where
     * the user faces +Z. Bundles of the kind {@code dram} see where the face points and how the head nods; the others make the same motion with and
     * without.
     */
    public void pushUserHead(float x, float y, float z, float qx, float qy, float qz, float qw, long timeNanos) {
        Native.pushPose(handle, x, y, z, qx, qy, qz, qw, timeNanos * 1e-9);
    }

    /**
     * Writes how much each joint follows the user rather than the agent's own voice and habit in the last block's frames, 0 to 1, frame by frame,
     * joints as in the rig: the read-out of bundles of the kind {@code dram}.
     *
     * @return numbers written: 4 times the number of joints, or 0 before the first block and where another bundle made the last one
     * @throws IllegalArgumentException when there is not that much room
     */
    public int dyadic(@NonNull float[] out, int offset) {
        return Native.dyadic(handle, out, offset);
    }

    /**
     * Sets the gaze target from the next block on, -1 to 1: 0 is averted, 1 sustained eye contact.
     *
     * @throws IllegalArgumentException outside -1 to 1
     */
    public void setGaze(float target) {
        Native.setGaze(handle, target);
    }

    /** Leaves the gaze to the model from the next block on. */
    public void setNaturalGaze() {
        Native.setNaturalGaze(handle);
    }

    /** Sets the guidance weights, 0 to 20: of the conditioning as a whole (1 is none), and of the gaze target. */
    public void setGuidance(float weight, float gaze) {
        Native.setGuidance(handle, weight, gaze);
    }

    /**
     * Sets the sampler from the next block on.
     *
     * @throws IllegalArgumentException when this session has no room, or the bundle no student, for it
     */
    public void setSampler(@NonNull Sampler sampler) {
        Native.setSampler(handle, sampler.name);
    }

    /**
     * Sets the milliseconds that a block may take, 1 to 133.3, from the next block on: a governor then chooses the sampler of each block,
     * the session's at best. 0 pins the session's sampler.
     *
     * @throws IllegalArgumentException for a budget out of range
     */
    public void setBudget(float milliseconds) {
        Native.setBudget(handle, milliseconds);
    }

    /**
     * Gives a session with a budget an engine of the kind {@code dram}, of the same rig and delays, to step down to: where blocks of even the
     * cheapest sampler come late, that engine makes the motion, instead of a pose being held, through a cross-fade both ways. {@link #dyadic} tells of
     * its frames, {@link SessionStats#governorFallbackBlocks} counts its blocks. A reset keeps it; the engine may be closed afterwards. Takes its turn,
     * as {@link #poll} does.
     *
     * @throws IllegalArgumentException when this session's own engine is of the kind {@code dram}, the other is not, or their rigs or delays differ
     * @throws IllegalStateException when this session or that engine is closed
     */
    public void setFallback(@NonNull VisavisEngine engine) {
        Native.setFallback(handle, engine.handle());
    }

    /**
     * Tells the governor how long the last block took by the caller's clock, in place of what the session measured: for a thread whose deadline
     * covers more than {@link #poll}.
     */
    public void reportBlockTime(double milliseconds) {
        Native.reportBlockTime(handle, milliseconds);
    }

    /** The sampler that was set; with a budget, the best one that is used. */
    @NonNull
    public Sampler sampler() {
        return Sampler.of(Native.sampler(handle));
    }

    /** Where things are in what {@link #poll} writes. */
    @NonNull
    public FrameLayout layout() {
        return layout;
    }

    /** As {@link #poll(long, FloatBuffer)} at {@link #sessionTimeNanos()}. */
    public int poll(@NonNull FloatBuffer frames) {
        return poll(sessionTimeNanos(), frames);
    }

    /**
     * Computes the next block if it is due, and writes its frames from the buffer's position on, as {@link FrameLayout} says.
     * Call it until it returns 0: who comes late gets all blocks that were missed. Nothing is allocated.
     *
     * @param timeNanos session time; never runs backwards
     * @return frames written: 4, or 0 when no block is due
     * @throws IllegalArgumentException when the buffer is too small (nothing is computed), not direct, or read-only
     * @throws IllegalStateException when time runs backwards, or this session is closed
     */
    public int poll(long timeNanos, @NonNull FloatBuffer frames) {
        checked(frames);
        if (frames.isReadOnly()) {
            throw new IllegalArgumentException("the buffer is read-only");
        }
        return Native.pollBuffer(handle, seconds(timeNanos), frames, frames.position(), frames.remaining());
    }

    /** As {@link #poll(long, FloatBuffer)}, into an array from {@code offset} on. */
    public int poll(long timeNanos, @NonNull float[] frames, int offset) {
        return Native.pollArray(handle, seconds(timeNanos), frames, offset);
    }

    /** Session time by the system's clock: nanoseconds since this session was made or reset. */
    public long sessionTimeNanos() {
        return System.nanoTime() - start;
    }

    /** Session time at which the next block is due, nanoseconds. */
    public long nextDueNanos() {
        return (long) Math.ceil(Native.nextDue(handle) * 1e9 - 0.5);
    }

    /** Starts anew with the options of now; session time is 0 again. Same inputs, same bits. What was pushed before is dropped. */
    public void reset() {
        Native.reset(handle);
        start = System.nanoTime();
    }

    /** Computes two blocks for nothing and starts anew, so that memory and CPU are warm when the first block is due. */
    public void warmUp() {
        warmUp(2);
    }

    /** The same with another number of blocks. */
    public void warmUp(int blocks) {
        Native.warmUp(handle, blocks);
        start = System.nanoTime();
    }

    /** Statistics so far. */
    @NonNull
    public SessionStats stats() {
        return new SessionStats(Native.stats(handle));
    }

    /**
     * Kernel ids of the threads that this session owns and computes on: none with one thread. For performance hints, together with
     * {@link Visavis#currentThreadId()} of the thread that polls.
     */
    @NonNull
    public int[] workerThreadIds() {
        return Native.workerThreadIds(handle);
    }

    /** Ends the session; a call that is under way on another thread still ends as it should. Closing twice does nothing. */
    @Override
    public void close() {
        Native.sessionClose(handle);
    }

    long handle() {
        return handle;
    }

    private void push(int voice, FloatBuffer samples, int rate) {
        checked(samples);
        Native.pushBuffer(handle, voice, samples, samples.position(), samples.remaining(), rate);
    }

    private static void checked(FloatBuffer buffer) {
        if (!buffer.isDirect()) {
            throw new IllegalArgumentException("the buffer is not direct: use ByteBuffer.allocateDirect, or the variant for arrays");
        }
        if (buffer.order() != ByteOrder.nativeOrder()) {
            throw new IllegalArgumentException("the buffer is not in native byte order: add .order(ByteOrder.nativeOrder())");
        }
    }

    private static double seconds(long nanos) {
        return nanos * 1e-9;
    }
}
