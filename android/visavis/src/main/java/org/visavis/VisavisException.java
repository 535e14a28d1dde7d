package org.visavis;

/** Something failed that is not the caller's fault; also a fault of the library, with its text. */
public class VisavisException extends RuntimeException {
    private static final long serialVersionUID = 1L;

    /** Made by the native library. */
    public VisavisException(String message) {
        super(message);
    }
}
