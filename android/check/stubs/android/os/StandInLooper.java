package android.os;

import java.util.ArrayList;
import java.util.List;

/** The main thread's queue; a test is the main thread and runs it for a while. */
public final class StandInLooper {
    private static final class Task {
        final Runnable action;
        final long due;

        Task(Runnable action, long due) {
            this.action = action;
            this.due = due;
        }
    }

    private static final List<Task> QUEUE = new ArrayList<>();

    private StandInLooper() {}

    public static void post(Runnable action, long millis) {
        synchronized (QUEUE) {
            QUEUE.add(new Task(action, System.nanoTime() + millis * 1_000_000));
        }
    }

    /** Runs what comes due within this time. */
    public static void run(long millis) throws InterruptedException {
        long end = System.nanoTime() + millis * 1_000_000;
        while (System.nanoTime() < end) {
            Task next = null;
            synchronized (QUEUE) {
                for (Task task : QUEUE) {
                    if (task.due <= System.nanoTime() && (next == null || task.due < next.due)) {
                        next = task;
                    }
                }
                QUEUE.remove(next);
            }
            if (next == null) {
                Thread.sleep(2);
            } else {
                next.action.run();
            }
        }
    }
}
