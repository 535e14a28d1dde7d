package org.visavis.demo;

/**
 * The microphone as the user sees it: off, asked for, denied, opening, on, lost and tried again, or given up. The user interface toggles, the thread that
 * has the microphone reports; both may call at any time. Times are System.nanoTime.
 */
final class MicrophoneState {
    enum State {
        OFF,
        ASKING,
        DENIED,
        /** Denied for good: only the system's settings can change it. */
        BLOCKED,
        OPENING,
        ON,
        /** Was not to be had; tried again at a time that is set. */
        RETRYING,
        FAILED,
    }

    /** Attempts before it is given up. */
    static final int ATTEMPTS = 5;
    private static final long SECOND = 1_000_000_000L;
    /** An open microphone that gives nothing for so long is lost. */
    private static final long SILENT = 2 * SECOND;

    private State state = State.OFF;
    private String reason = "";
    private int failures;
    private long next;
    private long captured;
    private long grown;

    synchronized State state() {
        return state;
    }

    /** The user's button. Returns whether the permission must be asked for. */
    synchronized boolean toggle(boolean permitted, long now) {
        switch (state) {
            case OFF:
            case DENIED:
            case BLOCKED:
            case FAILED:
                failures = 0;
                reason = "";
                if (permitted) {
                    open(now);
                    return false;
                }
                state = State.ASKING;
                return true;
            default:
                state = State.OFF;
                return false;
        }
    }

    /** The answer to the question; {@code again}: it may be asked another time. */
    synchronized void answered(boolean permitted, boolean again, long now) {
        if (state != State.ASKING) {
            return;
        }
        if (permitted) {
            open(now);
        } else {
            state = again ? State.DENIED : State.BLOCKED;
        }
    }

    /** Back on the screen: the permission may have been given or taken in the settings meanwhile. */
    synchronized void permission(boolean permitted, long now) {
        if (permitted && (state == State.DENIED || state == State.BLOCKED)) {
            open(now);
        } else if (!permitted && (state == State.OPENING || state == State.ON || state == State.RETRYING)) {
            state = State.DENIED;
        }
    }

    private void open(long now) {
        state = State.OPENING;
        next = now;
    }

    /** Whether the microphone should be open, by now. */
    synchronized boolean wanted() {
        return state == State.OPENING || state == State.ON || state == State.RETRYING;
    }

    /** Whether to try and open it now. */
    synchronized boolean due(long now) {
        return (state == State.OPENING || state == State.RETRYING) && now - next >= 0;
    }

    synchronized void opened(long now) {
        if (wanted()) {
            state = State.ON;
            captured = 0;
            grown = now;
        }
    }

    synchronized void failed(String why, long now) {
        if (!wanted()) {
            return;
        }
        reason = why;
        failures++;
        if (failures >= ATTEMPTS) {
            state = State.FAILED;
        } else {
            state = State.RETRYING;
            next = now + (SECOND << (failures - 1));
        }
    }

    /** It is open and has captured so many samples; {@code ended}: it says that it ended by itself. Returns whether it is lost and must be closed. */
    synchronized boolean lost(long samples, boolean ended, long now) {
        if (state != State.ON) {
            return false;
        }
        if (samples != captured) {
            captured = samples;
            grown = now;
            failures = 0;
        }
        if (ended || now - grown > SILENT) {
            failed(ended ? "it was taken away" : "it gives no sound", now);
            return true;
        }
        return false;
    }

    /** Closed because the app pauses; it is opened again when the app goes on. */
    synchronized void suspended(long now) {
        if (state == State.ON) {
            open(now);
        }
    }

    /** What the button does. */
    synchronized String action() {
        switch (state) {
            case OFF:
                return "Use the microphone";
            case DENIED:
                return "Ask again for the microphone";
            case BLOCKED:
                return "Allow it in the settings";
            case FAILED:
                return "Try the microphone again";
            default:
                return "Microphone off";
        }
    }

    /** What the user should know. */
    synchronized String says(long now) {
        switch (state) {
            case OFF:
                return "The user's voice: the sample";
            case ASKING:
                return "Waiting for the permission";
            case DENIED:
                return "Microphone not allowed. The user's voice is the sample.";
            case BLOCKED:
                return "Microphone not allowed: give this app the permission in the settings. The user's voice is the sample.";
            case OPENING:
                return "Opening the microphone";
            case ON:
                return captured == 0 ? "Microphone on, no sound yet" : "The user's voice: your microphone";
            case RETRYING:
                long seconds = Math.max(0, (next - now + SECOND - 1) / SECOND);
                return "No microphone: " + reason + ". Next try in " + seconds + " s (" + (failures + 1) + " of " + ATTEMPTS + ")";
            default:
                return "No microphone: " + reason + ". The user's voice is the sample.";
        }
    }
}
