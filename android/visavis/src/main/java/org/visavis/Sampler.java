package org.visavis;

import androidx.annotation.NonNull;
import androidx.annotation.Nullable;

/** How a block of motion is made: evaluations of the network against quality. */
public final class Sampler {
    /** The reference: 8 evaluations a block. */
    public static final Sampler MIDPOINT4 = new Sampler("midpoint4");
    /** 4 evaluations. */
    public static final Sampler MIDPOINT2 = new Sampler("midpoint2");
    /** 2 evaluations. */
    public static final Sampler MIDPOINT1 = new Sampler("midpoint1");
    /** The distilled student: 1 evaluation. Needs a bundle that has one, see {@link VisavisEngine#hasStudent()}. */
    public static final Sampler SINGLE = new Sampler("single");

    final String name;

    private Sampler(String name) {
        this.name = name;
    }

    /** Euler's rule with 1 to 64 steps, one evaluation each. */
    @NonNull
    public static Sampler euler(int steps) {
        return new Sampler("euler:" + steps);
    }

    /** The name that the command line uses too. */
    @Override
    @NonNull
    public String toString() {
        return name;
    }

    @Override
    public boolean equals(@Nullable Object other) {
        return other instanceof Sampler && name.equals(((Sampler) other).name);
    }

    @Override
    public int hashCode() {
        return name.hashCode();
    }

    static Sampler of(String name) {
        return new Sampler(name);
    }
}
