package org.visavis.demo;

import static org.visavis.demo.DemoCheck.equal;
import static org.visavis.demo.DemoCheck.isTrue;

import java.io.ByteArrayInputStream;
import java.io.IOException;
import org.visavis.BundleException;
import org.visavis.VisavisException;
import org.visavis.demo.MicrophoneState.State;

/** Whether the conversation runs, and what becomes of the microphone. */
final class StateTest {
    private static final long SECOND = 1_000_000_000L;

    private StateTest() {}

    private static Life running() {
        Life life = new Life();
        life.loaded();
        life.shown(true);
        isTrue(!life.runs() && life.wantsFocus(), "not without the audio focus");
        life.focus(Life.Focus.HAD);
        isTrue(life.runs(), "runs");
        equal("", life.says());
        return life;
    }

    static void testLife() {
        Life life = running();
        life.shown(false);
        isTrue(!life.runs() && !life.wantsFocus(), "away");
        life.shown(true);
        life.hold(true);
        isTrue(!life.runs() && life.stands(), "held");
        isTrue(life.says().contains("Go on"), life.says());
        life.hold(false);
        life.measuring(true);
        isTrue(!life.runs() && life.says().contains("measurement"), "measuring");
        life.measuring(false);
        isTrue(life.runs(), "goes on");
        life.failed(Failure.of("computing", new IllegalStateException("x")));
        isTrue(!life.runs() && !life.wantsFocus(), "failed");
        life.again();
        isTrue(!life.runs() && life.failure() == null, "loads anew");
        life.loaded();
        isTrue(life.runs(), "runs again");
    }

    static void testFocus() {
        Life life = running();
        life.focus(Life.Focus.DUCKED);
        isTrue(life.runs() && life.volume() < 0.5f, "lower");
        life.focus(Life.Focus.AWAY);
        isTrue(!life.runs() && life.wantsFocus(), "waits for it");
        life.focus(Life.Focus.HAD);
        isTrue(life.runs() && life.volume() == 1, "comes back by itself");
        life.focus(Life.Focus.LOST);
        isTrue(!life.runs() && !life.wantsFocus() && life.stands(), "lost");
        life.unfocused();
        isTrue(life.stands() && life.says().contains("Another app"), "stays lost: " + life.says());
        life.hold(false);
        isTrue(life.wantsFocus() && !life.runs(), "asks again when the user says so");
        life.focus(Life.Focus.HAD);
        isTrue(life.runs(), "runs");
    }

    static void testMicrophoneOnAndOff() {
        MicrophoneState microphone = new MicrophoneState();
        equal("Use the microphone", microphone.action());
        isTrue(microphone.toggle(false, 0), "asks");
        equal(State.ASKING, microphone.state());
        isTrue(!microphone.wanted(), "not before the answer");
        microphone.answered(true, false, 0);
        isTrue(microphone.wanted() && microphone.due(0), "opens");
        microphone.opened(0);
        equal(State.ON, microphone.state());
        isTrue(microphone.says(0).contains("no sound yet"), microphone.says(0));
        isTrue(!microphone.lost(480, false, SECOND) && microphone.says(0).contains("your microphone"), microphone.says(0));
        isTrue(!microphone.due(SECOND), "open once");
        isTrue(!microphone.toggle(true, SECOND) && !microphone.wanted(), "off");
        microphone.opened(SECOND);
        equal(State.OFF, microphone.state());
    }

    static void testMicrophoneDenied() {
        MicrophoneState microphone = new MicrophoneState();
        microphone.toggle(false, 0);
        microphone.answered(false, true, 0);
        equal(State.DENIED, microphone.state());
        isTrue(microphone.says(0).contains("not allowed") && microphone.says(0).contains("sample"), microphone.says(0));
        isTrue(microphone.toggle(false, 0), "asks again");
        microphone.answered(false, false, 0);
        equal(State.BLOCKED, microphone.state());
        isTrue(microphone.says(0).contains("settings") && microphone.action().contains("settings"), "says where");
        microphone.permission(true, 0);
        equal(State.OPENING, microphone.state());
        microphone.opened(0);
        microphone.permission(false, 0);
        equal(State.DENIED, microphone.state());
    }

    /** Lost while it was open: tried after 1, 2, 4 and 8 seconds, then given up, and all of it can be read. */
    static void testMicrophoneLostAndRetried() {
        MicrophoneState microphone = new MicrophoneState();
        microphone.toggle(true, 0);
        microphone.opened(0);
        isTrue(!microphone.lost(1, false, SECOND), "gives sound");
        isTrue(microphone.lost(1, true, 2 * SECOND), "ended");
        equal(State.RETRYING, microphone.state());
        isTrue(microphone.says(2 * SECOND).contains("taken away") && microphone.says(2 * SECOND).contains("1 s (2 of 5)"), microphone.says(2 * SECOND));
        long now = 2 * SECOND;
        for (int wait : new int[] {1, 2, 4}) {
            isTrue(!microphone.due(now + wait * SECOND - 1), "not yet");
            now += wait * SECOND;
            isTrue(microphone.due(now), "after " + wait + " s");
            microphone.failed("the device says no", now);
        }
        now += 8 * SECOND;
        isTrue(microphone.due(now), "the last try");
        microphone.failed("the device says no", now);
        equal(State.FAILED, microphone.state());
        isTrue(microphone.says(now).contains("the device says no") && !microphone.due(now + 60 * SECOND), microphone.says(now));
        isTrue(!microphone.toggle(true, now) && microphone.due(now), "the button starts anew");
        microphone.opened(now);
        isTrue(microphone.lost(0, false, now + 3 * SECOND), "one that gives nothing is lost");
        isTrue(microphone.says(now).contains("gives no sound"), microphone.says(now));
    }

    static void testMicrophoneComesBackAfterAPause() {
        MicrophoneState microphone = new MicrophoneState();
        microphone.suspended(0);
        equal(State.OFF, microphone.state());
        microphone.toggle(true, 0);
        microphone.opened(0);
        microphone.suspended(SECOND);
        isTrue(microphone.due(SECOND), "opened again");
        // A microphone that worked has all its tries again.
        microphone.opened(SECOND);
        for (int i = 0; i < 3; i++) {
            microphone.failed("busy", 2 * SECOND);
        }
        microphone.opened(9 * SECOND);
        microphone.lost(5, false, 9 * SECOND);
        microphone.failed("busy", 10 * SECOND);
        isTrue(microphone.says(10 * SECOND).contains("(2 of 5)"), microphone.says(10 * SECOND));
    }

    static void testFailuresSayWhatToDo() {
        Throwable[] errors = {
            new UnsatisfiedLinkError("no visavis_jni in java.library.path"), new BundleException.Version("format 9"), new BundleException.Corrupt("short"),
            new IOException("not there"), new VisavisException("a fault"), new OutOfMemoryError("heap"), new IllegalStateException("other"),
        };
        String[] todos = {"arm64-v8a", "same source", "Install the APK again", "Install the APK again", "fault of the library", "Close other apps", "Try again"};
        for (int i = 0; i < errors.length; i++) {
            Failure failure = Failure.of("loading the model", errors[i]);
            equal("Failed: loading the model", failure.what);
            isTrue(failure.todo.contains(todos[i]), errors[i] + ": " + failure.todo);
            isTrue(failure.details.contains(errors[i].getMessage()), "the error's own words");
        }
        Failure nested = Failure.of("x", new IOException("outer", new IllegalArgumentException("inner")));
        isTrue(nested.toString().contains("inner"), "causes too");
    }

    static void testProgress() throws IOException {
        Loading loading = new Loading();
        loading.step("One", 0.2f);
        loading.step("Two", 0.6f);
        float last = loading.fraction();
        isTrue(Math.abs(last - 0.2f) < 1e-6, "a step that is done");
        java.io.InputStream in = loading.watched(new ByteArrayInputStream(new byte[1000]), 1000);
        for (int i = 0; i < 10; i++) {
            isTrue(in.read(new byte[100], 0, 100) == 100, "read");
            isTrue(loading.fraction() > last, "moves with the bytes");
            last = loading.fraction();
        }
        isTrue(Math.abs(last - 0.6f) < 1e-5, "to the step's end: " + last);
        loading.step("Three", 1);
        isTrue(Math.abs(loading.fraction() - 0.6f) < 1e-5, "no step is counted twice: " + loading.fraction());
        loading.finished();
        isTrue(loading.fraction() == 1, "done");
    }
}
