package org.visavis;

/** There is no microphone to be had: no device, no permission, or refused by the platform. Go on without the user's voice. */
public final class MicrophoneException extends Exception {
    private static final long serialVersionUID = 1L;

    /** Made by the native library. */
    public MicrophoneException(String message) {
        super(message);
    }
}
