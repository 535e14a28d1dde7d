package org.visavis.demo;

import static org.visavis.demo.DemoCheck.equal;
import static org.visavis.demo.DemoCheck.isTrue;

import android.app.StandInScreen;
import android.content.Intent;
import android.content.StandInContext;
import android.graphics.StandInPicture;
import android.media.AudioManager;
import android.media.StandInSound;
import android.os.StandInLooper;
import android.view.MotionEvent;
import android.view.StandInWindow;
import android.view.View;
import android.view.ViewGroup;
import android.widget.Button;
import android.widget.ProgressBar;
import android.widget.TextView;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;

/** The activities, driven as the system drives them. */
final class ActivityTest {
    private ActivityTest() {}

    /** All that can be read on the screen. */
    static String read(View view) {
        List<String> found = new ArrayList<>();
        for (View each : all(view)) {
            if (each instanceof TextView && each.getVisibility() == View.VISIBLE) {
                found.add(((TextView) each).getText().toString());
            }
        }
        return String.join("\n", found);
    }

    private static List<View> all(View view) {
        List<View> found = new ArrayList<>();
        found.add(view);
        if (view instanceof ViewGroup) {
            for (int i = 0; i < ((ViewGroup) view).getChildCount(); i++) {
                found.addAll(all(((ViewGroup) view).getChildAt(i)));
            }
        }
        return found;
    }

    private static void press(ScreenActivity activity, String label) {
        for (View each : all(StandInScreen.content(activity))) {
            if (each instanceof Button && ((Button) each).getText().toString().contains(label)) {
                each.performClick();
                return;
            }
        }
        throw new AssertionError("no button " + label + " in:\n" + read(StandInScreen.content(activity)));
    }

    private static String text(ScreenActivity activity) {
        return read(StandInScreen.content(activity));
    }

    /** Runs the main thread until the screen says so. */
    static void until(ScreenActivity activity, String part) throws InterruptedException {
        for (int i = 0; i < 600; i++) {
            StandInLooper.run(100);
            if (text(activity).contains(part)) {
                return;
            }
        }
        throw new AssertionError("never on the screen: " + part + "; but:\n" + text(activity));
    }

    private static DemoActivity open() throws InterruptedException {
        DemoActivity activity = StandInScreen.open(new DemoActivity(), new Intent("main"), false);
        until(activity, "x real time");
        return activity;
    }

    static void testLoadsAndRuns() throws Exception {
        long before = System.nanoTime();
        DemoActivity activity = StandInScreen.open(new DemoActivity(), new Intent("main"), false);
        isTrue(System.nanoTime() - before < 200_000_000L, "the main thread does not load");
        isTrue(all(StandInScreen.content(activity)).stream().anyMatch(v -> v instanceof ProgressBar), "a bar");
        isTrue(text(activity).contains("Loading"), text(activity));
        until(activity, "x real time");
        isTrue(StandInSound.plays() && StandInSound.hasFocus(), "the voice is heard");
        isTrue(all(StandInScreen.content(activity)).stream().anyMatch(View::getKeepScreenOn), "the screen stays on");
        StandInScreen.leave(activity);
        StandInLooper.run(200);
        isTrue(!StandInSound.plays() && !StandInSound.hasFocus(), "leaving it stops the voice");
        StandInScreen.comeBack(activity);
        until(activity, "x real time");
        StandInLooper.run(300);
        isTrue(StandInSound.plays(), "coming back goes on");
        StandInScreen.close(activity);
        StandInLooper.run(300);
        isTrue(!StandInSound.plays(), "closing it stops the voice");
    }

    static void testAChangeDoesNotStartAnew() throws Exception {
        DemoActivity first = open();
        Motion motion = first.demo.motion();
        press(first, "Hold");
        long blocks = motion.times().count();
        DemoActivity second = StandInScreen.change(first, new DemoActivity());
        until(second, "Held");
        isTrue(second.demo.motion() == motion && motion.isAlive(), "the same conversation");
        press(second, "Go on");
        StandInLooper.run(500);
        isTrue(motion.times().count() > blocks, "goes on");
        StandInScreen.close(second);
        motion.join(2000);
        isTrue(!motion.isAlive(), "its end is the conversation's");
    }

    static void testFocus() throws Exception {
        DemoActivity activity = open();
        StandInSound.changeFocus(AudioManager.AUDIOFOCUS_LOSS_TRANSIENT_CAN_DUCK);
        StandInLooper.run(200);
        isTrue(StandInSound.plays() && StandInSound.volume() < 0.5f, "lower");
        StandInSound.changeFocus(AudioManager.AUDIOFOCUS_LOSS_TRANSIENT);
        until(activity, "for a moment");
        isTrue(!StandInSound.plays(), "silent");
        StandInSound.changeFocus(AudioManager.AUDIOFOCUS_GAIN);
        until(activity, "x real time");
        StandInSound.changeFocus(AudioManager.AUDIOFOCUS_LOSS);
        until(activity, "Another app");
        isTrue(!StandInSound.plays(), "silent");
        press(activity, "Go on");
        until(activity, "x real time");
        StandInLooper.run(300);
        isTrue(StandInSound.plays() && StandInSound.hasFocus(), "taken back");
        StandInScreen.close(activity);
    }

    /** This machine has no microphone: refused, allowed, tried, and all of it can be read. */
    static void testMicrophone() throws Exception {
        StandInContext.permitted = false;
        DemoActivity activity = open();
        isTrue(text(activity).contains("the sample"), text(activity));
        press(activity, "Use the microphone");
        isTrue(StandInScreen.asked(activity), "asks");
        until(activity, "Waiting for the permission");
        StandInScreen.answer(activity, false, false);
        until(activity, "not allowed");
        press(activity, "Allow it in the settings");
        equal("android.settings.APPLICATION_DETAILS_SETTINGS package:org.visavis.demo",
                StandInContext.STARTED.get(StandInContext.STARTED.size() - 1).toString());
        StandInScreen.leave(activity);
        StandInContext.permitted = true;
        StandInScreen.comeBack(activity);
        until(activity, "No microphone");
        until(activity, "(3 of 5)");
        press(activity, "Microphone off");
        until(activity, "the sample");
        isTrue(activity.demo.life.runs(), "the conversation runs on");
        StandInScreen.close(activity);
    }

    static void testFailureBeforeTheFirstBlock() throws Exception {
        Path model = DemoCheck.assets.resolve(Demo.BUNDLE);
        byte[] good = Files.readAllBytes(model);
        Files.write(model, new byte[1000]);
        DemoActivity activity = StandInScreen.open(new DemoActivity(), new Intent("main"), false);
        try {
            until(activity, "Failed: loading the model");
            isTrue(text(activity).contains("Install the APK again") && text(activity).contains("BundleException"), text(activity));
            press(activity, "Share");
            isTrue(StandInContext.clipboard().contains("loading the model"), "to the clipboard");
        } finally {
            Files.write(model, good);
        }
        press(activity, "Try again");
        until(activity, "x real time");
        StandInScreen.close(activity);
        Files.delete(model);
        activity = StandInScreen.open(new DemoActivity(), new Intent("main"), false);
        try {
            until(activity, "Failed: loading the model");
        } finally {
            Files.write(model, good);
        }
        StandInScreen.close(activity);
    }

    static void testMeasure() throws Exception {
        DemoActivity stage = open();
        Motion motion = stage.demo.motion();
        press(stage, "Measure");
        StandInScreen.leave(stage);
        MeasureActivity first = StandInScreen.open(new MeasureActivity(), new Intent("measure").putExtra("minutes", 1), false);
        until(first, "midpoint4 ");
        Measurement measurement = first.demo.measurement();
        long blocks = motion.times().count();
        MeasureActivity second = StandInScreen.change(first, new MeasureActivity());
        until(second, "minute 1 of 1");
        isTrue(second.demo.measurement() == measurement && measurement.isAlive(), "a change leaves one measurement");
        isTrue(second.demo.measure(1, null) == measurement, "never two at once");
        equal(blocks, motion.times().count());
        isTrue(all(StandInScreen.content(second)).stream().anyMatch(View::getKeepScreenOn), "the screen stays on");
        press(second, "Share");
        String shared = StandInContext.clipboard();
        isTrue(shared.contains("sampler") && shared.contains("API 29") && shared.contains("single"), shared);
        StandInScreen.leave(second);
        measurement.join(3000);
        isTrue(!measurement.isAlive() && measurement.report().contains("stopped: the app was left"), measurement.report());
        press(second, "Back");
        StandInScreen.close(second);
        StandInScreen.comeBack(stage);
        until(stage, "x real time");
        StandInLooper.run(300);
        isTrue(motion.times().count() > blocks, "the conversation goes on");
        StandInScreen.close(stage);
    }

    /** The whole of it with short rows: every sampler and thread count, the minutes, the heat, the governor. */
    static void testReport() throws Exception {
        Heat heat = new Heat() {
            @Override
            public float battery() {
                return 31.2f;
            }

            @Override
            public String status() {
                return "light";
            }
        };
        try (org.visavis.VisavisEngine engine = org.visavis.VisavisEngine.fromFile(DemoCheck.bundle)) {
            Measurement measurement = new Measurement(engine, DemoCheck.wav("agent.wav"), DemoCheck.wav("user.wav"), 2, heat, new Life(), 4, 0.7);
            measurement.start();
            measurement.join();
            String[] lines = measurement.report().split("\n");
            int samplers = Bench.samplers(engine).length;
            equal(Bench.HEAD, lines[1]);
            for (int i = 0; i < 2 * samplers; i++) {
                String[] cells = lines[2 + i].trim().split(" +");
                equal(Bench.SAMPLERS[i / 2].toString(), cells[0]);
                equal(String.valueOf(1 + i % 2), cells[1]);
                isTrue(Float.parseFloat(cells[2]) > 0 && Float.parseFloat(cells[5]) >= Float.parseFloat(cells[2]), lines[2 + i]);
            }
            String[] minute = lines[lines.length - 1].trim().split(" +");
            equal("2", minute[0]);
            equal("light,", minute[minute.length - 3]);
            equal("31.2", minute[minute.length - 2]);
            isTrue(Float.parseFloat(minute[5]) >= 1 && measurement.fraction() == 1 && measurement.doing().isEmpty(), measurement.report());
        }
    }

    static void testFingersAndWindows() throws Exception {
        DemoActivity activity = open();
        View content = StandInScreen.content(activity);
        StandInWindow.insets(content, 60, 40, 30);
        for (int[] size : new int[][] {{1280, 800}, {1080, 2200}, {2200, 1080}, {1600, 2400}, {400, 340}}) {
            StandInPicture.of(content, size[0], size[1]);
            View split = ((ViewGroup) content).getChildAt(0);
            isTrue(StandInWindow.left(split) == 30 && StandInWindow.top(split) == 60 && split.getHeight() == size[1] - 100, "insets");
            View stage = all(content).stream().filter(v -> v instanceof StageView).findFirst().orElseThrow(AssertionError::new);
            isTrue(stage.getWidth() >= size[0] / 2 - 60 && stage.getHeight() >= (size[1] - 100) / 2, "the stage has at least half of " + size[0] + " x " + size[1]);
            float[] at = new float[3];
            new Projection(stage.getWidth(), stage.getHeight(), 0, 0, 0, 0).project(0, 0, 1.5f, at);
            StandInWindow.touch(stage, MotionEvent.ACTION_DOWN, at[0], at[1]);
            float x = activity.demo.motion().userX();
            float z = activity.demo.motion().userZ();
            StandInWindow.touch(stage, MotionEvent.ACTION_MOVE, at[0] + stage.getWidth() * 0.05f, at[1]);
            isTrue(activity.demo.motion().userX() > x, "right");
            StandInWindow.touch(stage, MotionEvent.ACTION_MOVE, at[0], at[1] - stage.getHeight() * 0.05f);
            isTrue(activity.demo.motion().userZ() < z, "up is further away, of " + size[0] + " x " + size[1] + ": " + z + " to " + activity.demo.motion().userZ());
            StandInWindow.touch(stage, MotionEvent.ACTION_UP, 0, 0);
        }
        StandInScreen.close(activity);
    }
}
