package android.content;

import android.content.res.AssetManager;

public class Context {
    public AssetManager getAssets() {
        throw new UnsupportedOperationException();
    }

    public final String getString(int id, Object... arguments) {
        throw new UnsupportedOperationException();
    }

    public int checkSelfPermission(String permission) {
        throw new UnsupportedOperationException();
    }
}
