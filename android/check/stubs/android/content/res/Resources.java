package android.content.res;

import android.util.DisplayMetrics;

public class Resources {
    final DisplayMetrics metrics = new DisplayMetrics();

    Resources() {}

    public DisplayMetrics getDisplayMetrics() {
        return metrics;
    }

    public String getString(int id) {
        return StandInAssets.string(id).replace("%%", "%");
    }

    public String getString(int id, Object... arguments) {
        return String.format(StandInAssets.string(id), arguments);
    }
}
