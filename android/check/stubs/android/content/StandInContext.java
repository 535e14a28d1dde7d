package android.content;

import android.content.pm.PackageManager;
import android.content.res.AssetManager;
import android.content.res.Resources;
import android.content.res.StandInAssets;
import android.media.StandInSound;
import android.os.BatteryManager;
import android.os.StandInServices;
import java.util.ArrayList;
import java.util.List;

/** The app's process: one for all, as a test sets it up. */
public class StandInContext extends Context {
    public static AssetManager assets;
    public static boolean permitted;
    public static final List<Intent> STARTED = new ArrayList<>();
    private static final ClipboardManager CLIPBOARD = new ClipboardManager();

    public static String clipboard() {
        return CLIPBOARD.data == null ? "" : CLIPBOARD.data.text.toString();
    }

    public static Object extra(Intent intent, String name) {
        return intent.extras.get(name);
    }

    @Override
    public AssetManager getAssets() {
        return assets;
    }

    @Override
    public Resources getResources() {
        return StandInAssets.RESOURCES;
    }

    @Override
    public Context getApplicationContext() {
        return this;
    }

    @Override
    public Object getSystemService(String name) {
        switch (name) {
            case AUDIO_SERVICE:
                return StandInSound.MANAGER;
            case POWER_SERVICE:
                return StandInServices.power();
            case CLIPBOARD_SERVICE:
                return CLIPBOARD;
            default:
                return null;
        }
    }

    @Override
    public String getPackageName() {
        return "org.visavis.demo";
    }

    @Override
    public int checkSelfPermission(String permission) {
        return permitted ? PackageManager.PERMISSION_GRANTED : PackageManager.PERMISSION_DENIED;
    }

    @Override
    public void startActivity(Intent intent) {
        STARTED.add(intent);
    }

    @Override
    public Intent registerReceiver(BroadcastReceiver receiver, IntentFilter filter) {
        return new Intent(Intent.ACTION_BATTERY_CHANGED).putExtra(BatteryManager.EXTRA_TEMPERATURE, 312);
    }
}
