package android.content;

import android.content.res.AssetManager;
import android.content.res.Resources;

public abstract class Context {
    public static final String POWER_SERVICE = "power";
    public static final String AUDIO_SERVICE = "audio";
    public static final String CLIPBOARD_SERVICE = "clipboard";

    public abstract AssetManager getAssets();

    public abstract Resources getResources();

    public abstract Context getApplicationContext();

    public abstract Object getSystemService(String name);

    public abstract String getPackageName();

    public abstract int checkSelfPermission(String permission);

    public abstract void startActivity(Intent intent);

    public abstract Intent registerReceiver(BroadcastReceiver receiver, IntentFilter filter);

    public final String getString(int id) {
        return getResources().getString(id);
    }

    public final String getString(int id, Object... arguments) {
        return getResources().getString(id, arguments);
    }
}
