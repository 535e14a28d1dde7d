package org.visavis.demo;

import android.content.Context;
import android.media.AudioAttributes;
import android.media.AudioFocusRequest;
import android.media.AudioManager;

/** The audio focus: asked for while the conversation wants it, and what becomes of it told to {@link Life}. For the main thread. */
final class Focus implements AudioManager.OnAudioFocusChangeListener {
    private final AudioManager manager;
    private final Life life;
    private final AudioFocusRequest request;
    private boolean taken;

    Focus(Context context, Life life) {
        manager = (AudioManager) context.getSystemService(Context.AUDIO_SERVICE);
        this.life = life;
        request = new AudioFocusRequest.Builder(AudioManager.AUDIOFOCUS_GAIN)
            .setAudioAttributes(new AudioAttributes.Builder()
                .setUsage(AudioAttributes.USAGE_MEDIA)
                .setContentType(AudioAttributes.CONTENT_TYPE_SPEECH)
                .build())
            .setWillPauseWhenDucked(false)
            .setOnAudioFocusChangeListener(this)
            .build();
    }

    /** Asks for it, or gives it back, as the conversation needs it now. */
    void keep() {
        boolean wanted = life.wantsFocus();
        if (wanted && !taken) {
            taken = true;
            boolean granted = manager.requestAudioFocus(request) == AudioManager.AUDIOFOCUS_REQUEST_GRANTED;
            life.focus(granted ? Life.Focus.HAD : Life.Focus.LOST);
        } else if (!wanted && taken) {
            taken = false;
            manager.abandonAudioFocusRequest(request);
            life.unfocused();
        }
    }

    @Override
    public void onAudioFocusChange(int change) {
        if (!taken) {
            return;
        }
        switch (change) {
            case AudioManager.AUDIOFOCUS_GAIN:
                life.focus(Life.Focus.HAD);
                break;
            case AudioManager.AUDIOFOCUS_LOSS_TRANSIENT_CAN_DUCK:
                life.focus(Life.Focus.DUCKED);
                break;
            case AudioManager.AUDIOFOCUS_LOSS_TRANSIENT:
                life.focus(Life.Focus.AWAY);
                break;
            default:
                life.focus(Life.Focus.LOST);
        }
    }
}
