package android.media;

public class AudioTrack {
    public static final int MODE_STREAM = 1;
    public static final int WRITE_NON_BLOCKING = 1;

    public static int getMinBufferSize(int sampleRateInHz, int channelConfig, int audioFormat) {
        return 0;
    }

    public void play() {
    }

    public int write(float[] audioData, int offsetInFloats, int sizeInFloats, int writeMode) {
        return 0;
    }

    public void release() {
    }

    public static class Builder {
        public Builder setAudioAttributes(AudioAttributes attributes) {
            return this;
        }

        public Builder setAudioFormat(AudioFormat format) {
            return this;
        }

        public Builder setBufferSizeInBytes(int bufferSizeInBytes) {
            return this;
        }

        public Builder setTransferMode(int mode) {
            return this;
        }

        public AudioTrack build() {
            return new AudioTrack();
        }
    }
}
