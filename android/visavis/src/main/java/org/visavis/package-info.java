/**
 * Full-body motion of a virtual agent from two voices and the user's head.
 *
 * <p>Load a {@link org.visavis.VisavisEngine} from a bundle, make a {@link org.visavis.VisavisSession} on it, push voices and
 * head positions as they come, and poll frames. World coordinates are right-handed, Y up, metres; times are nanoseconds of
 * session time, which starts at 0.
 *
 * <p>Nothing here calls back: the application polls. Failures are exceptions: {@code IllegalArgumentException} for arguments
 * out of range, {@code IllegalStateException} for closed objects and calls that do not fit the state,
 * {@link org.visavis.BundleException} for bundles that cannot be used, {@link org.visavis.VisavisException} for a fault of the library.
 */
package org.visavis;
