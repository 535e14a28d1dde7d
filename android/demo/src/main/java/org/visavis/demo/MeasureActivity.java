package org.visavis.demo;

import android.content.Intent;
import android.os.Bundle;
import android.util.Log;
import android.view.View;

/**
 * Measures this device: {@code adb shell am start -n org.visavis.demo/.MeasureActivity [--ei minutes 10]}, then {@code adb logcat -s visavis}.
 */
public final class MeasureActivity extends ScreenActivity {
    private static final int MINUTES = 10;

    private Measurement mine;
    private int logged;

    @Override
    protected void onCreate(Bundle state) {
        super.onCreate(state);
        if (state != null) {
            mine = demo.measurement(); // made anew: the one that is under way, or has ended
        }
    }

    @Override
    protected void onNewIntent(Intent intent) {
        super.onNewIntent(intent);
        setIntent(intent);
        mine = null;
    }

    @Override
    protected void onStop() {
        super.onStop();
        if (mine != null && !isChangingConfigurations()) {
            mine.cancel("the app was left");
            log();
        }
    }

    @Override
    Object subject() {
        if (mine == null) {
            int minutes = Math.max(0, Math.min(120, getIntent().getIntExtra("minutes", MINUTES)));
            mine = demo.measure(minutes, new DeviceHeat(this));
            logged = 0;
            Log.i(TAG, header());
        }
        return mine;
    }

    @Override
    Screen screen() {
        final Screen[] made = new Screen[1];
        made[0] = new MeasureScreen(this, mine, header(), new View.OnClickListener() {
            @Override
            public void onClick(View clicked) {
                share(((MeasureScreen) made[0]).text());
            }
        }, new View.OnClickListener() {
            @Override
            public void onClick(View clicked) {
                finish();
            }
        });
        return made[0];
    }

    @Override
    void refresh() {
        super.refresh();
        log();
    }

    /** What the report has gained since the last time, line by line. */
    private void log() {
        if (mine == null) {
            return;
        }
        String report = mine.report();
        for (int end; (end = report.indexOf('\n', logged)) >= 0; logged = end + 1) {
            Log.i(TAG, report.substring(logged, end));
        }
    }
}
