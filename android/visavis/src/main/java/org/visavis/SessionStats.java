package org.visavis;

import androidx.annotation.NonNull;

/** Statistics of a session since its start or reset. */
public final class SessionStats {
    /** Blocks computed. */
    public final long blocks;
    /** Computation time of a block over the last 4096, milliseconds: median. */
    public final double blockMsP50;
    /** 95th percentile. */
    public final double blockMsP95;
    /** 99th percentile. */
    public final double blockMsP99;
    /** Maximum. */
    public final double blockMsMax;
    /** From something that the user does to the start of the first block that can answer, at most, milliseconds. */
    public final double userDelayMs;
    /** The same for the agent's own voice; 0 when it is known ahead. */
    public final double agentDelayMs;
    /** Times that recent motion was encoded anew. */
    public final long anchorings;
    /** Bytes of all key-value caches. */
    public final long cacheBytes;
    /** The agent's voice. */
    @NonNull
    public final Voice agentVoice;
    /** The user's voice. */
    @NonNull
    public final Voice userVoice;
    /** Head positions that were taken. */
    public final long headAccepted;
    /** Ignored: not finite. */
    public final long headNonFinite;
    /** Ignored: late (a block has used one of that time or later), or at the time of another. */
    public final long headOutOfOrder;
    /** Ignored: more than 1 km away, or a time of more than 10 million seconds. */
    public final long headAbsurd;
    /** Taken, but too far from the one before to have walked there. */
    public final long headTeleports;
    /** Dropped to make room before they were asked for. */
    public final long headOverwritten;

    /** Sounds in the room. */
    @NonNull
    public final Sounds sounds;

    /** Blocks that took longer than the budget; this and the next five are 0 without a budget. */
    public final long governorMissed;
    /** Changes to a cheaper sampler. */
    public final long governorDown;
    /** Changes to a better sampler. */
    public final long governorUp;
    /** Blocks whose motion was held because even the cheapest sampler took too long. */
    public final long governorHeldBlocks;
    /** Blocks that the fallback made instead of a pose being held ({@link VisavisSession#setFallback}). */
    public final long governorFallbackBlocks;
    /** Passes spent on bringing skipped flow times up to date. */
    public final long governorCatchUpPasses;
    /** Times that the plausibility guard took over. */
    public final long guardTrips;
    /** Frames that it held, or faded back. */
    public final long guardHeldFrames;

    /** Counters of a voice, samples of 24 kHz unless said otherwise. */
    public static final class Voice {
        /** Silence in place of sound that had not come, while the voice was present. */
        public final long underrunSamples;
        /** Dropped because so much sound was waiting already, a minute by default. */
        public final long overflowSamples;
        /** Clipped to 8 times full scale, input samples: a sign of integers pushed as floats. */
        public final long clippedSamples;
        /** Not finite, which silence replaced, input samples. */
        public final long nonFiniteSamples;
        /** Pushed at a rate out of range and not taken, input samples. */
        public final long badRateSamples;
        /** Dropped because another thread was inside this voice's input and lost its core there for long, input samples. */
        public final long contendedSamples;

        Voice(Row row) {
            underrunSamples = row.count();
            overflowSamples = row.count();
            clippedSamples = row.count();
            nonFiniteSamples = row.count();
            badRateSamples = row.count();
            contendedSamples = row.count();
        }
    }

    /** Counters of all sound sources in the room together; 0 where the bundle has no hearing. */
    public static final class Sounds {
        /** Pushes that were taken, whole or in part. */
        public final long pieces;
        /** Sources that began to sound. */
        public final long started;
        /** Dropped because a source was more than ten seconds ahead, samples of 24 kHz. */
        public final long overflowSamples;
        /** Clipped to 64 pascals, input samples: a sign of integers pushed as floats. */
        public final long clippedSamples;
        /** Not finite, which silence replaced, input samples. */
        public final long nonFiniteSamples;
        /** Pushed at a rate out of range and not taken, input samples. */
        public final long badRateSamples;
        /** Pushes with a place that is no number or absurdly far. */
        public final long badPlaces;
        /** Dropped because another thread was inside the same source's input and lost its core there for long, input samples. */
        public final long contendedSamples;
        /** Pushes and sources that were dropped because too many, or sixteen louder ones, sounded. */
        public final long refused;
        /** Sources that gave way to a louder one. */
        public final long replaced;

        Sounds(Row row) {
            pieces = row.count();
            started = row.count();
            overflowSamples = row.count();
            clippedSamples = row.count();
            nonFiniteSamples = row.count();
            badRateSamples = row.count();
            badPlaces = row.count();
            contendedSamples = row.count();
            refused = row.count();
            replaced = row.count();
        }
    }

    /** What the native library gives, read from the front. */
    private static final class Row {
        private final double[] values;
        private int next;

        Row(double[] values) {
            this.values = values;
        }

        double number() {
            return values[next++];
        }

        long count() {
            return (long) number();
        }
    }

    SessionStats(double[] values) {
        Row row = new Row(values);
        blocks = row.count();
        blockMsP50 = row.number();
        blockMsP95 = row.number();
        blockMsP99 = row.number();
        blockMsMax = row.number();
        userDelayMs = row.number();
        agentDelayMs = row.number();
        anchorings = row.count();
        cacheBytes = row.count();
        agentVoice = new Voice(row);
        userVoice = new Voice(row);
        headAccepted = row.count();
        headNonFinite = row.count();
        headOutOfOrder = row.count();
        headAbsurd = row.count();
        headTeleports = row.count();
        headOverwritten = row.count();
        sounds = new Sounds(row);
        governorMissed = row.count();
        governorDown = row.count();
        governorUp = row.count();
        governorHeldBlocks = row.count();
        governorFallbackBlocks = row.count();
        governorCatchUpPasses = row.count();
        guardTrips = row.count();
        guardHeldFrames = row.count();
        if (row.next != values.length) {
            throw new VisavisException("the native library gives " + values.length + " statistics, not " + row.next);
        }
    }
}
