package org.visavis.demo;

import java.io.IOException;
import org.visavis.BundleException;
import org.visavis.VisavisException;

/** What failed, and what the user can do about it. */
final class Failure {
    /** What failed. */
    final String what;
    /** What to do. */
    final String todo;
    /** The error's own words. */
    final String details;

    private Failure(String what, String todo, String details) {
        this.what = what;
        this.todo = todo;
        this.details = details;
    }

    /** @param doing what was under way, such as "loading the model" */
    static Failure of(String doing, Throwable e) {
        return new Failure("Failed: " + doing, remedy(e), words(e));
    }

    private static String remedy(Throwable e) {
        if (e instanceof UnsatisfiedLinkError || e instanceof NoClassDefFoundError || e instanceof ExceptionInInitializerError) {
            return "The app's library does not run here. It is made for 64-bit ARM (arm64-v8a) and Android 10 or newer; an APK that was linked"
                    + " against stand-ins of the NDK runs nowhere. Install an APK that was built with Google's NDK.";
        }
        if (e instanceof BundleException.Version) {
            return "The model is of another version than the app. Build app and model from the same source.";
        }
        if (e instanceof BundleException || e instanceof IOException) {
            return "A file of the app is missing or damaged. Install the APK again; if it was built by hand, the model must be stored in it uncompressed.";
        }
        if (e instanceof OutOfMemoryError) {
            return "There is not enough memory. Close other apps and try again.";
        }
        if (e instanceof VisavisException) {
            return "This is a fault of the library. Try again; if it comes back, share this report with its developers.";
        }
        return "Try again; if it comes back, share this report with the app's developers.";
    }

    private static String words(Throwable e) {
        StringBuilder text = new StringBuilder();
        for (Throwable cause = e; cause != null; cause = cause.getCause()) {
            text.append(text.length() == 0 ? "" : "\nbecause of ").append(cause);
        }
        StackTraceElement[] trace = e.getStackTrace();
        for (int i = 0; i < Math.min(6, trace.length); i++) {
            text.append("\n  at ").append(trace[i]);
        }
        return text.toString();
    }

    @Override
    public String toString() {
        return what + "\n\n" + todo + "\n\n" + details;
    }
}
