package org.visavis.demo;

import android.app.Activity;
import android.os.Bundle;
import android.util.Log;
import java.io.IOException;
import org.visavis.VisavisEngine;
import org.visavis.VisavisException;

/** The benchmark without a screen: {@code adb shell am start -n org.visavis.demo/.BenchActivity}, then {@code adb logcat -s visavis}. */
public final class BenchActivity extends Activity {
    private static final String TAG = "visavis";
    private static final int BLOCKS = 225; // half a minute of motion

    @Override
    protected void onCreate(Bundle state) {
        super.onCreate(state);
        new Thread(this::bench, "visavis-bench").start();
    }

    private void bench() {
        try (VisavisEngine engine = VisavisEngine.fromAsset(getAssets(), DemoActivity.BUNDLE)) {
            Wav agent = Wav.fromAsset(getAssets(), "agent.wav");
            Wav user = Wav.fromAsset(getAssets(), "user.wav");
            Bench.run(engine, agent, user, BLOCKS, text -> Log.i(TAG, text));
        } catch (IOException | VisavisException e) {
            Log.e(TAG, "benchmark failed", e);
        }
        runOnUiThread(this::finish);
    }
}
