package org.visavis;

/** A bundle cannot be used; nothing of it was kept. */
public class BundleException extends VisavisException {
    private static final long serialVersionUID = 1L;

    /** Made by the native library. */
    public BundleException(String message) {
        super(message);
    }

    /** Damaged: not a bundle, truncated, or with numbers that are not finite. Fetch it again. */
    public static final class Corrupt extends BundleException {
        private static final long serialVersionUID = 1L;

        /** Made by the native library. */
        public Corrupt(String message) {
            super(message);
        }
    }

    /** Of a format that this library does not read. Update the library, or export the bundle again. */
    public static final class Version extends BundleException {
        private static final long serialVersionUID = 1L;

        /** Made by the native library. */
        public Version(String message) {
            super(message);
        }
    }

    /** Its config and its tensors disagree, or sizes are out of range. */
    public static final class Invalid extends BundleException {
        private static final long serialVersionUID = 1L;

        /** Made by the native library. */
        public Invalid(String message) {
            super(message);
        }
    }
}
