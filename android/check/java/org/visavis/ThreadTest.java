package org.visavis;

import static org.visavis.Check.engine;
import static org.visavis.Check.isTrue;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import java.util.concurrent.atomic.AtomicReference;

/** Threads. */
final class ThreadTest {
    private static final int BLOCKS = 3;

    private ThreadTest() {}

    private static void together(List<Check.Action> actions) throws Exception {
        AtomicReference<Throwable> failure = new AtomicReference<>();
        List<Thread> threads = new ArrayList<>();
        for (Check.Action action : actions) {
            Thread thread = new Thread(() -> {
                try {
                    action.run();
                } catch (Throwable e) {
                    failure.compareAndSet(null, e);
                }
            });
            threads.add(thread);
            thread.start();
        }
        for (Thread thread : threads) {
            thread.join();
        }
        if (failure.get() != null) {
            throw new AssertionError(failure.get());
        }
    }

    static void testSessionsOnSeveralThreadsShareAnEngine() throws Exception {
        try (VisavisEngine engine = engine()) {
            float[][] last = new float[4][];
            List<Check.Action> actions = new ArrayList<>();
            for (int t = 0; t < last.length; t++) {
                int index = t;
                actions.add(() -> {
                    try (VisavisSession session = engine.newSession(new SessionOptions().threads(1 + index % 2))) {
                        Conversation.push(session, 1, 16_000);
                        float[] out = new float[session.layout().blockFloats()];
                        for (int k = 0; k < BLOCKS; k++) {
                            session.poll(session.nextDueNanos(), out, 0);
                        }
                        last[index] = out;
                    }
                });
            }
            together(actions);
            for (float[] other : last) {
                isTrue(Arrays.equals(last[0], other), "the same inputs, the same bits");
            }
        }
    }

    /** One session used by all threads at once, and closed by one of them: frames, or exceptions of the kind that says so. */
    static void testRaces() throws Exception {
        try (VisavisEngine engine = engine()) {
            VisavisSession session = engine.newSession();
            float[] sound = new float[480];
            List<Check.Action> actions = new ArrayList<>();
            for (int t = 0; t < 4; t++) {
                int kind = t;
                actions.add(() -> {
                    float[] out = new float[session.layout().blockFloats()];
                    try {
                        for (int i = 0; i < 1_000_000; i++) {
                            switch (kind) {
                                case 0:
                                    session.pushAgentAudio(sound, 0, sound.length, 48_000);
                                    break;
                                case 1:
                                    session.pushUserHead(0, 1.6f, 1.5f, i);
                                    break;
                                case 2:
                                    session.poll(session.nextDueNanos(), out, 0);
                                    break;
                                default:
                                    session.stats();
                            }
                        }
                    } catch (IllegalStateException e) {
                        isTrue(e.getMessage().contains("closed"), e.getMessage());
                    }
                });
            }
            actions.add(() -> {
                while (session.stats().blocks < BLOCKS) {
                    Thread.yield();
                }
                session.close();
            });
            together(actions);
        }
    }
}
