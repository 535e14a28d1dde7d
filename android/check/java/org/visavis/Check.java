package org.visavis;

import java.io.File;
import java.io.IOException;
import java.lang.reflect.InvocationTargetException;
import java.lang.reflect.Method;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.FloatBuffer;

/**
 * Runs the tests: every static method whose name starts with "test" of the classes below, in order. Arguments: the tiny bundle, beside which dram-tcn.safetensors and hearing.safetensors lie, the number
 * of open-and-close cycles, and the number of blocks of a digest. Prints "digest NAME HEX" lines, for comparison between machines.
 */
public final class Check {
    static File bundle;
    static int cycles;
    static int blocks;

    private Check() {}

    /** What a test does. */
    interface Action {
        void run() throws Exception;
    }

    public static void main(String[] args) throws Exception {
        bundle = new File(args[0]);
        cycles = Integer.parseInt(args[1]);
        blocks = Integer.parseInt(args[2]);
        int count = 0;
        for (Class<?> tests : new Class<?>[] {EngineTest.class, SessionTest.class, ErrorTest.class, ThreadTest.class, LeakTest.class, DigestTest.class}) {
            Method[] methods = tests.getDeclaredMethods();
            java.util.Arrays.sort(methods, (a, b) -> a.getName().compareTo(b.getName()));
            for (Method method : methods) {
                if (!method.getName().startsWith("test")) {
                    continue;
                }
                try {
                    method.invoke(null);
                } catch (InvocationTargetException e) {
                    System.out.println("FAILED " + tests.getSimpleName() + "." + method.getName());
                    e.getCause().printStackTrace(System.out);
                    System.exit(1);
                }
                count++;
                System.out.println("ok " + tests.getSimpleName() + "." + method.getName());
            }
        }
        int[] open = Native.openObjects();
        isTrue(open[0] == 0 && open[1] == 0 && open[2] == 0, "objects left open: " + java.util.Arrays.toString(open));
        System.out.println(count + " tests passed on " + System.getProperty("os.arch"));
    }

    static VisavisEngine engine() throws IOException {
        return VisavisEngine.fromFile(bundle);
    }

    /** One of the featherweight tier, which lies beside the first. */
    static VisavisEngine light() throws IOException {
        return VisavisEngine.fromFile(new File(bundle.getParentFile(), "dram-tcn.safetensors"));
    }

    /** One with hearing. */
    static VisavisEngine hearing() throws IOException {
        return VisavisEngine.fromFile(new File(bundle.getParentFile(), "hearing.safetensors"));
    }

    static FloatBuffer direct(int floats) {
        return ByteBuffer.allocateDirect(4 * floats).order(ByteOrder.nativeOrder()).asFloatBuffer();
    }

    static void isTrue(boolean condition, String what) {
        if (!condition) {
            throw new AssertionError(what);
        }
    }

    static void equal(Object expected, Object actual) {
        isTrue(expected.equals(actual), "expected " + expected + ", got " + actual);
    }

    /** The action throws exactly this class, with a message that contains the part. */
    static void throwsWith(Class<? extends Throwable> kind, String part, Action action) {
        try {
            action.run();
        } catch (Throwable e) {
            isTrue(e.getClass() == kind, "expected " + kind.getName() + ", got " + e);
            isTrue(String.valueOf(e.getMessage()).contains(part), "message without \"" + part + "\": " + e.getMessage());
            return;
        }
        throw new AssertionError("nothing thrown; expected " + kind.getName());
    }
}
