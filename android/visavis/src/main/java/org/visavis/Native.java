package org.visavis;

import java.io.IOException;
import java.nio.ByteBuffer;
import java.nio.FloatBuffer;

/** The native library. Objects are numbers above 0 that are never used twice; voices are 0 (agent) and 1 (user). */
final class Native {
    static {
        System.loadLibrary("visavis_jni");
    }

    private Native() {}

    static native long engineFromPath(String path) throws IOException;

    static native long engineFromFd(int fd, long offset, long length) throws IOException;

    static native long engineFromBuffer(ByteBuffer buffer, int position, int length);

    static native long engineFromBytes(byte[] bytes);

    static native boolean engineClose(long engine);

    static native String engineName(long engine);

    static native boolean engineHasStudent(long engine);

    static native boolean engineHasHearing(long engine);

    static native String[] engineJointNames(long engine);

    static native int[] engineJointParents(long engine);

    static native float[] engineRestOffsets(long engine);

    static native String[] openXrNames();

    static native String[] openXrFollows();

    static native int openXrJoint(String name);

    static native long sessionNew(long engine, long seed, int threads, long coreMask, String sampler, float gaze, float guidance,
            float gazeGuidance, float temperature, double x, double z, double yaw, boolean stance, boolean guard,
            float budget, double voiceAhead, float sensitivity);

    static native boolean sessionClose(long session);

    static native void pushBuffer(long session, int voice, FloatBuffer samples, int position, int count, int rate);

    static native void pushArray(long session, int voice, float[] samples, int offset, int count, int rate);

    static native void finishVoice(long session, int voice);

    static native void clearVoice(long session, int voice);

    static native void setVoicePresent(long session, int voice, boolean present);

    static native void pushSoundBuffer(long session, int id, FloatBuffer samples, int position, int count, int rate, float x, float y, float z);

    static native void pushSoundArray(long session, int id, float[] samples, int offset, int count, int rate, float x, float y, float z);

    static native void endSound(long session, int id);

    static native void pushEars(long session, float[] left, float[] right, int offset, int count, int rate);

    static native void endEars(long session);

    static native boolean heardPlace(long session, float[] out, int offset);

    static native void setSensitivity(long session, float sensitivity);

    static native void pushHead(long session, float x, float y, float z, double time);

    static native void pushPose(long session, float x, float y, float z, float qx, float qy, float qz, float qw, double time);

    static native int dyadic(long session, float[] out, int offset);

    static native void setGaze(long session, float target);

    static native void setNaturalGaze(long session);

    static native void setGuidance(long session, float weight, float gaze);

    static native void setSampler(long session, String sampler);

    static native void setBudget(long session, float milliseconds);

    static native void setFallback(long session, long engine);

    static native void reportBlockTime(long session, double milliseconds);

    static native String sampler(long session);

    static native int pollBuffer(long session, double now, FloatBuffer out, int position, int count);

    static native int pollArray(long session, double now, float[] out, int offset);

    static native double nextDue(long session);

    static native void reset(long session);

    static native void warmUp(long session, int blocks);

    static native int[] workerThreadIds(long session);

    static native double[] stats(long session);

    static native long microphoneOpen(int rate, float seconds) throws MicrophoneException;

    static native boolean microphoneClose(long microphone);

    static native int microphoneRate(long microphone);

    static native long[] microphoneCounters(long microphone);

    static native int microphonePump(long microphone, long session);

    static native String version();

    static native int currentThreadId();

    static native void pinCurrentThread(long mask);

    /** Open engines, sessions and microphones. */
    static native int[] openObjects();

    /** Panics with this text, for tests of a build. */
    static native void panic(String text);
}
