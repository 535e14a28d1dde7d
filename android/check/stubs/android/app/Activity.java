package android.app;

import android.content.Context;
import android.content.Intent;
import android.content.StandInContext;
import android.content.res.AssetManager;
import android.content.res.Resources;
import android.os.Bundle;
import android.view.View;

public class Activity extends Context {
    private final StandInContext base = new StandInContext();
    Intent intent = new Intent("");
    View content;
    boolean finishing;
    boolean changing;
    boolean rationale;
    String[] asked;

    @Override
    public AssetManager getAssets() {
        return base.getAssets();
    }

    @Override
    public Resources getResources() {
        return base.getResources();
    }

    @Override
    public Context getApplicationContext() {
        return base;
    }

    @Override
    public Object getSystemService(String name) {
        return base.getSystemService(name);
    }

    @Override
    public String getPackageName() {
        return base.getPackageName();
    }

    @Override
    public int checkSelfPermission(String permission) {
        return base.checkSelfPermission(permission);
    }

    @Override
    public void startActivity(Intent intent) {
        base.startActivity(intent);
    }

    @Override
    public Intent registerReceiver(android.content.BroadcastReceiver receiver, android.content.IntentFilter filter) {
        return base.registerReceiver(receiver, filter);
    }

    public Intent getIntent() {
        return intent;
    }

    public void setIntent(Intent intent) {
        this.intent = intent;
    }

    protected void onCreate(Bundle state) {}

    protected void onStart() {}

    protected void onResume() {}

    protected void onPause() {}

    protected void onStop() {}

    protected void onDestroy() {}

    protected void onNewIntent(Intent intent) {}

    public void onRequestPermissionsResult(int code, String[] permissions, int[] results) {}

    public final void requestPermissions(String[] permissions, int code) {
        asked = permissions;
    }

    public boolean shouldShowRequestPermissionRationale(String permission) {
        return rationale;
    }

    public boolean isFinishing() {
        return finishing;
    }

    public boolean isChangingConfigurations() {
        return changing;
    }

    public void setContentView(View view) {
        content = view;
    }

    public void finish() {
        finishing = true;
    }
}
