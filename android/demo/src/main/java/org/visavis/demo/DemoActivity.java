package org.visavis.demo;

import android.Manifest;
import android.content.Intent;
import android.content.pm.PackageManager;
import android.net.Uri;
import android.os.Bundle;
import android.provider.Settings;

/** An agent to look at and to talk to. */
public final class DemoActivity extends ScreenActivity implements StageScreen.Actions {
    private static final int ASKED = 1;

    private Focus focus;

    @Override
    protected void onCreate(Bundle state) {
        super.onCreate(state);
        focus = new Focus(this, demo.life);
    }

    @Override
    protected void onResume() {
        super.onResume();
        demo.microphone.permission(permitted(), System.nanoTime());
        demo.life.shown(true);
        focus.keep();
    }

    @Override
    protected void onPause() {
        super.onPause();
        demo.life.shown(false);
        focus.keep();
    }

    @Override
    Object subject() {
        return demo.motion();
    }

    @Override
    Screen screen() {
        return new StageScreen(this, demo, this);
    }

    @Override
    void refresh() {
        focus.keep();
        super.refresh();
    }

    @Override
    public void microphone() {
        boolean blocked = demo.microphone.state() == MicrophoneState.State.BLOCKED;
        if (blocked) {
            startActivity(new Intent(Settings.ACTION_APPLICATION_DETAILS_SETTINGS, Uri.fromParts("package", getPackageName(), null)));
        } else if (demo.microphone.toggle(permitted(), System.nanoTime())) {
            requestPermissions(new String[] {Manifest.permission.RECORD_AUDIO}, ASKED);
        }
    }

    @Override
    public void measure() {
        startActivity(new Intent(this, MeasureActivity.class));
    }

    private boolean permitted() {
        return checkSelfPermission(Manifest.permission.RECORD_AUDIO) == PackageManager.PERMISSION_GRANTED;
    }

    @Override
    public void onRequestPermissionsResult(int code, String[] permissions, int[] results) {
        super.onRequestPermissionsResult(code, permissions, results);
        // No results: the question was interrupted, and may be asked again.
        boolean again = results.length == 0 || shouldShowRequestPermissionRationale(Manifest.permission.RECORD_AUDIO);
        demo.microphone.answered(permitted(), again, System.nanoTime());
    }
}
