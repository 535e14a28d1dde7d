package org.visavis;

import static org.visavis.Check.engine;
import static org.visavis.Check.isTrue;

import java.nio.FloatBuffer;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import java.util.concurrent.CountDownLatch;
import java.util.concurrent.atomic.AtomicBoolean;
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

    /** While one thread has the session for long, others push and set, from one buffer too, and are through before. */
    static void testNobodyWaitsForABlock() throws Exception {
        try (VisavisEngine engine = engine();
                VisavisSession session = engine.newSession()) {
            // Who waited for the session would come last however long it is away; who lost their core may need another try.
            boolean through = false;
            for (int blocks = 500; !through && blocks <= 8_000; blocks *= 4) {
                through = pushesEndFirst(session, blocks);
            }
            isTrue(through, "pushes while another thread is inside the session");
        }
    }

    private static boolean pushesEndFirst(VisavisSession session, int blocks) throws Exception {
        AtomicBoolean over = new AtomicBoolean();
        AtomicBoolean late = new AtomicBoolean();
        CountDownLatch inside = new CountDownLatch(1);
        FloatBuffer sound = Check.direct(480);
        List<Check.Action> actions = new ArrayList<>();
        actions.add(() -> {
            inside.countDown();
            session.warmUp(blocks);
            over.set(true);
        });
        for (int t = 0; t < 2; t++) {
            int thread = t;
            actions.add(() -> {
                inside.await();
                Thread.sleep(20);
                for (int i = 0; i < 200; i++) {
                    session.pushAgentAudio(sound, 48_000);
                    session.pushUserAudio(sound, 48_000);
                    session.pushUserHead(0, 1.6f, 1.5f, i * 2_000_000L + thread);
                    session.setGaze(0.5f);
                    session.setGuidance(1.3f, 2);
                    session.setBudget(0);
                    session.setUserAudioPresent(true);
                }
                late.compareAndSet(false, over.get());
            });
        }
        together(actions);
        return !late.get();
    }

    /** Threads push their part of the inputs, one of them in pieces: the motion is that of one thread. */
    static void testWhoPushesDoesNotMatter() throws Exception {
        try (VisavisEngine engine = engine();
                VisavisSession one = engine.newSession();
                VisavisSession several = engine.newSession()) {
            Conversation.push(one, 1, 44_100);
            FloatBuffer agent = Conversation.voice(44_100, 44_100, 120, 0);
            FloatBuffer user = Conversation.voice(44_100, 44_100, 190, 1);
            together(Arrays.asList(
                    () -> {
                        for (int from = 0; from < 44_100; from += 441) {
                            FloatBuffer piece = agent.duplicate();
                            piece.position(from).limit(from + 441);
                            several.pushAgentAudio(piece, 44_100);
                        }
                    },
                    () -> several.pushUserAudio(user, 44_100),
                    () -> Conversation.walk(several, 0, 60),
                    () -> Conversation.walk(several, 1, 60)));
            float[] a = new float[one.layout().blockFloats()];
            float[] b = new float[a.length];
            for (int k = 0; k < BLOCKS; k++) {
                long due = one.nextDueNanos();
                one.poll(due, a, 0);
                several.poll(due, b, 0);
                isTrue(Arrays.equals(a, b), "block " + k);
            }
            isTrue(several.stats().headAccepted == 60, "heads");
        }
    }
}
