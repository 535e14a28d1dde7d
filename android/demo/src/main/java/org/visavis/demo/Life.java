package org.visavis.demo;

/** Whether the conversation runs, and why not: what the activity, the audio focus, a measurement and the user say, in one place. */
final class Life {
    /** What the audio focus allows. */
    enum Focus {
        /** Not asked for. */
        NONE,
        /** All of it. */
        HAD,
        /** At a lower volume, while something short is played. */
        DUCKED,
        /** Nothing, for a while; it comes back by itself. */
        AWAY,
        /** Nothing, until the user asks for it. */
        LOST,
    }

    private boolean loaded;
    private Failure failure;
    private boolean shown;
    private boolean held;
    private boolean measuring;
    private Focus focus = Focus.NONE;

    synchronized void loaded() {
        loaded = true;
        failure = null;
        notifyAll();
    }

    /** Something ended the conversation; {@link #again} starts anew. */
    synchronized void failed(Failure what) {
        failure = what;
        notifyAll();
    }

    synchronized void again() {
        failure = null;
        loaded = false;
        notifyAll();
    }

    /** Between the activity's onResume and onPause. */
    synchronized void shown(boolean now) {
        shown = now;
        notifyAll();
    }

    /** The user's own pause. Going on also asks again for a focus that was lost. */
    synchronized void hold(boolean now) {
        held = now;
        if (!now && focus == Focus.LOST) {
            focus = Focus.NONE;
        }
        notifyAll();
    }

    synchronized void measuring(boolean now) {
        measuring = now;
        notifyAll();
    }

    synchronized void focus(Focus now) {
        focus = now;
        notifyAll();
    }

    /** The focus was given back: it is asked for anew, unless another app took it for good. */
    synchronized void unfocused() {
        if (focus != Focus.LOST) {
            focus = Focus.NONE;
        }
    }

    synchronized Failure failure() {
        return failure;
    }

    synchronized boolean isLoaded() {
        return loaded;
    }

    /** Blocks are computed, the voice is heard, the microphone (if it is on) is open, and the screen stays on. */
    synchronized boolean runs() {
        return loaded && failure == null && shown && !held && !measuring && (focus == Focus.HAD || focus == Focus.DUCKED);
    }

    /** Whether the app should have the audio focus: it waits for one that is away. */
    synchronized boolean wantsFocus() {
        return loaded && failure == null && shown && !held && !measuring && focus != Focus.LOST;
    }

    /** The button that holds the conversation: what it does next is to go on. */
    synchronized boolean stands() {
        return held || focus == Focus.LOST;
    }

    synchronized float volume() {
        return focus == Focus.DUCKED ? 0.25f : 1;
    }

    /** Why nothing moves, for the user; empty while it runs. */
    synchronized String says() {
        if (failure != null || !loaded || runs()) {
            return "";
        }
        if (measuring) {
            return "Waiting for the measurement to end";
        }
        if (focus == Focus.LOST) {
            return "Another app has taken the sound: press Go on";
        }
        if (focus == Focus.AWAY) {
            return "Waiting: another app has the sound for a moment";
        }
        return held ? "Held: press Go on" : "Paused";
    }

    /** Waits until the conversation runs, but not for ever. */
    synchronized void await(long millis) throws InterruptedException {
        if (!runs()) {
            wait(millis);
        }
    }
}
