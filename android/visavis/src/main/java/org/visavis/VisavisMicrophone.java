package org.visavis;

import androidx.annotation.NonNull;

/**
 * The user's voice from the device's microphone, with the voice-communication preset: Android cancels the echo of what the device
 * plays, so that the agent does not hear itself. Needs the {@code RECORD_AUDIO} permission.
 */
public final class VisavisMicrophone implements AutoCloseable {
    private final long handle;

    private VisavisMicrophone(long handle) {
        this.handle = handle;
    }

    /**
     * Opens and starts the microphone at 48 kHz.
     *
     * @throws MicrophoneException when there is none to be had; the session then runs without the user's voice
     */
    @NonNull
    public static VisavisMicrophone open() throws MicrophoneException {
        return open(48_000, 2);
    }

    /**
     * Opens and starts the microphone.
     *
     * @param rate samples a second to ask for; the device may give others, see {@link #rate()}
     * @param seconds what is kept between two {@link #pump}s, 0.1 to 60; more is dropped and counted
     * @throws MicrophoneException when there is none to be had
     */
    @NonNull
    public static VisavisMicrophone open(int rate, float seconds) throws MicrophoneException {
        return new VisavisMicrophone(Native.microphoneOpen(rate, seconds));
    }

    /** Samples a second. */
    public int rate() {
        return Native.microphoneRate(handle);
    }

    /** Pushes what was captured since the last call to a session, as the user's voice; call it before each poll, from any thread. Returns the samples. */
    public int pump(@NonNull VisavisSession session) {
        return Native.microphonePump(handle, session.handle());
    }

    /** Samples that were captured. */
    public long captured() {
        return Native.microphoneCounters(handle)[0];
    }

    /** Samples that were dropped because nobody pumped. */
    public long dropped() {
        return Native.microphoneCounters(handle)[1];
    }

    /** Whether the stream has ended by itself, as when a headset is unplugged; open another. */
    public boolean ended() {
        return Native.microphoneCounters(handle)[2] != 0;
    }

    /** Stops and closes. Closing twice does nothing. */
    @Override
    public void close() {
        Native.microphoneClose(handle);
    }
}
