package android.media;

public final class AudioFormat {
    public static final int CHANNEL_OUT_MONO = 4;
    public static final int ENCODING_PCM_FLOAT = 4;

    int rate;

    private AudioFormat() {}

    public static class Builder {
        private final AudioFormat format = new AudioFormat();

        public Builder() {}

        public Builder setSampleRate(int sampleRate) {
            format.rate = sampleRate;
            return this;
        }

        public Builder setEncoding(int encoding) {
            return this;
        }

        public Builder setChannelMask(int channelMask) {
            return this;
        }

        public AudioFormat build() {
            return format;
        }
    }
}
