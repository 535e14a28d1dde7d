package org.visavis;

import static org.visavis.Check.bundle;
import static org.visavis.Check.cycles;
import static org.visavis.Check.equal;
import static org.visavis.Check.isTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Paths;
import java.util.Arrays;

/** Opening and closing again and again leaves nothing behind. */
final class LeakTest {
    /** Growth that is not a leak: the allocator's and the JVM's own. One session of the tiny bundle left behind each cycle is gigabytes. */
    private static final long ALLOWED = 256L << 20;

    private LeakTest() {}

    private static long resident() throws IOException {
        for (String line : Files.readAllLines(Paths.get("/proc/self/status"))) {
            if (line.startsWith("VmRSS:")) {
                return 1024 * Long.parseLong(line.replaceAll("[^0-9]", ""));
            }
        }
        throw new IOException("no VmRSS");
    }

    static void testOpenAndClose() throws Exception {
        int[] open = Native.openObjects();
        byte[] bytes = Files.readAllBytes(bundle.toPath());
        byte[] broken = Arrays.copyOf(bytes, bytes.length - 8);
        try (VisavisEngine shared = VisavisEngine.fromBytes(bytes)) {
            long before = 0;
            for (int i = 0; i < cycles; i++) {
                if (i == Math.min(cycles / 10, 200)) {
                    before = resident();
                }
                shared.newSession(new SessionOptions().threads(1 + i % 2)).close();
                if (i % 50 == 0) {
                    VisavisEngine.fromBytes(bytes).close();
                    Check.throwsWith(BundleException.Corrupt.class, "", () -> VisavisEngine.fromBytes(broken));
                    Check.throwsWith(VisavisException.class, "again", () -> Native.panic("again"));
                }
            }
            long grown = resident() - before;
            equal(open[0] + 1, Native.openObjects()[0]);
            equal(open[1], Native.openObjects()[1]);
            System.out.println("resident memory over " + cycles + " sessions: " + (grown >> 20) + " MiB more");
            // Under emulation the emulator's own memory is what is seen.
            isTrue(cycles < 1000 || grown < ALLOWED, "resident memory grew by " + (grown >> 20) + " MiB");
        }
    }
}
