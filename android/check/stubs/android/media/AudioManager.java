package android.media;

public class AudioManager {
    public static final int AUDIOFOCUS_GAIN = 1;
    public static final int AUDIOFOCUS_LOSS = -1;
    public static final int AUDIOFOCUS_LOSS_TRANSIENT = -2;
    public static final int AUDIOFOCUS_LOSS_TRANSIENT_CAN_DUCK = -3;
    public static final int AUDIOFOCUS_REQUEST_FAILED = 0;
    public static final int AUDIOFOCUS_REQUEST_GRANTED = 1;

    /** Whoever has the focus. */
    OnAudioFocusChangeListener holder;

    AudioManager() {}

    public interface OnAudioFocusChangeListener {
        void onAudioFocusChange(int change);
    }

    public int requestAudioFocus(AudioFocusRequest request) {
        if (!StandInSound.focus) {
            return AUDIOFOCUS_REQUEST_FAILED;
        }
        holder = request.listener;
        return AUDIOFOCUS_REQUEST_GRANTED;
    }

    public int abandonAudioFocusRequest(AudioFocusRequest request) {
        holder = null;
        return AUDIOFOCUS_REQUEST_GRANTED;
    }
}
