package org.visavis.demo;

import android.Manifest;
import android.app.Activity;
import android.content.pm.PackageManager;
import android.os.Bundle;
import android.widget.Button;
import android.widget.LinearLayout;
import android.widget.SeekBar;
import android.widget.TextView;
import java.io.IOException;
import org.visavis.FrameLayout;
import org.visavis.Sampler;
import org.visavis.VisavisEngine;
import org.visavis.VisavisException;
import org.visavis.VisavisSession;

/** An agent to look at: drag to move the user, a slider for the gaze, a button for the sampler, one for the microphone. */
public final class DemoActivity extends Activity {
    static final String BUNDLE = "visavis-base-i8.safetensors";
    private static final Sampler[] SAMPLERS = {Sampler.MIDPOINT4, Sampler.MIDPOINT2, Sampler.MIDPOINT1, Sampler.SINGLE};

    private VisavisEngine engine;
    private Motion motion;
    private int sampler;

    @Override
    protected void onCreate(Bundle state) {
        super.onCreate(state);
        try {
            engine = VisavisEngine.fromAsset(getAssets(), BUNDLE);
            motion = new Motion(engine, Wav.fromAsset(getAssets(), "agent.wav"), Wav.fromAsset(getAssets(), "user.wav"));
        } catch (IOException | VisavisException e) {
            TextView text = new TextView(this);
            text.setText(e.getMessage());
            setContentView(text);
            return;
        }
        setContentView(controls());
        motion.start();
    }

    private LinearLayout controls() {
        LinearLayout column = new LinearLayout(this);
        column.setOrientation(LinearLayout.VERTICAL);
        FrameLayout layout;
        try (VisavisSession probe = engine.newSession()) {
            layout = probe.layout();
        }
        column.addView(new StageView(this, motion, engine.skeleton(), layout), new LinearLayout.LayoutParams(-1, 0, 1));

        SeekBar gaze = new SeekBar(this);
        gaze.setMax(101);
        gaze.setProgress(0);
        TextView label = new TextView(this);
        label.setText(R.string.gaze_natural);
        gaze.setOnSeekBarChangeListener(new SeekBar.OnSeekBarChangeListener() {
            @Override
            public void onProgressChanged(SeekBar bar, int progress, boolean fromUser) {
                // Leftmost: natural.
                motion.setGaze(progress == 0 ? Float.NaN : (progress - 1) / 100f);
                label.setText(progress == 0 ? getString(R.string.gaze_natural) : getString(R.string.gaze_target, progress - 1));
            }

            @Override
            public void onStartTrackingTouch(SeekBar bar) {}

            @Override
            public void onStopTrackingTouch(SeekBar bar) {}
        });
        column.addView(label);
        column.addView(gaze);

        Button choose = new Button(this);
        choose.setText(SAMPLERS[0].toString());
        choose.setOnClickListener(view -> {
            sampler = (sampler + 1) % (engine.hasStudent() ? SAMPLERS.length : SAMPLERS.length - 1);
            motion.setSampler(SAMPLERS[sampler]);
            choose.setText(SAMPLERS[sampler].toString());
        });
        column.addView(choose);

        Button microphone = new Button(this);
        microphone.setText(R.string.microphone);
        microphone.setOnClickListener(view -> listen());
        column.addView(microphone);
        return column;
    }

    private void listen() {
        if (checkSelfPermission(Manifest.permission.RECORD_AUDIO) == PackageManager.PERMISSION_GRANTED) {
            motion.setListening(true);
        } else {
            requestPermissions(new String[] {Manifest.permission.RECORD_AUDIO}, 1);
        }
    }

    @Override
    public void onRequestPermissionsResult(int code, String[] permissions, int[] results) {
        super.onRequestPermissionsResult(code, permissions, results);
        if (results.length > 0 && results[0] == PackageManager.PERMISSION_GRANTED) {
            motion.setListening(true);
        }
    }

    @Override
    protected void onDestroy() {
        super.onDestroy();
        if (motion != null) {
            motion.finish();
        }
        if (engine != null) {
            engine.close();
        }
    }
}
