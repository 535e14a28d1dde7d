package org.visavis.demo;

import android.content.StandInContext;
import android.content.res.StandInAssets;
import java.io.File;
import java.io.FileInputStream;
import java.io.IOException;
import java.lang.reflect.InvocationTargetException;
import java.lang.reflect.Method;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Arrays;

/**
 * Tests of the demo app on a JVM: every static method whose name starts with "test" of the classes below, in order. Arguments: the tiny bundle; further
 * ones are ignored. The system property visavis.stage names what android/apk/stage.mjs makes of the tiny bundle, visavis.strings the app's strings.xml. With -Dvisavis.only=PART only classes with that part in their name. Runs in the repository's root.
 */
public final class DemoCheck {
    static File bundle;
    static Path assets;

    private DemoCheck() {}

    public static void main(String[] args) throws Exception {
        bundle = new File(args[0]);
        assets = Files.createTempDirectory("visavis");
        Files.copy(bundle.toPath(), assets.resolve(Demo.BUNDLE));
        for (String name : new String[] {"agent.wav", "user.wav"}) {
            Files.copy(Path.of("samples", name), assets.resolve(name));
        }
        Files.copy(Path.of(System.getProperty("visavis.stage")), assets.resolve(StageData.ASSET));
        StandInContext.assets = StandInAssets.folder(assets.toFile());
        int count = 0;
        try {
            for (Class<?> tests : new Class<?>[] {ProjectionTest.class, ClockTest.class, StateTest.class, SceneTest.class, StepTest.class,
                ActivityTest.class}) {
                if (!tests.getSimpleName().contains(System.getProperty("visavis.only", ""))) {
                    continue;
                }
                Method[] methods = tests.getDeclaredMethods();
                Arrays.sort(methods, (a, b) -> a.getName().compareTo(b.getName()));
                for (Method method : methods) {
                    if (method.getName().startsWith("test")) {
                        run(tests, method);
                        count++;
                    }
                }
            }
        } finally {
            for (File file : assets.toFile().listFiles()) {
                Files.delete(file.toPath());
            }
            Files.delete(assets);
        }
        System.out.println(count + " demo tests passed");
        System.exit(0);
    }

    private static void run(Class<?> tests, Method method) throws Exception {
        try {
            method.invoke(null);
            System.out.println("ok " + tests.getSimpleName() + "." + method.getName());
        } catch (InvocationTargetException e) {
            System.out.println("FAILED " + tests.getSimpleName() + "." + method.getName());
            e.getCause().printStackTrace(System.out);
            System.exit(1);
        }
    }

    static void isTrue(boolean condition, String what) {
        if (!condition) {
            throw new AssertionError(what);
        }
    }

    static void equal(Object expected, Object actual) {
        isTrue(expected.equals(actual), "expected " + expected + ", got " + actual);
    }

    static void near(double expected, double actual, double tolerance, String what) {
        isTrue(Math.abs(expected - actual) <= tolerance, what + ": expected " + expected + " within " + tolerance + ", got " + actual);
    }

    static Wav wav(String name) throws IOException {
        return Wav.read(new FileInputStream("samples/" + name), name);
    }
}
