package org.visavis.demo;

/** How hot the device is. */
interface Heat {
    /** Battery's temperature, degrees Celsius; NaN where nobody says. */
    float battery();

    /** The platform's thermal status, such as "none" or "severe". */
    String status();
}
