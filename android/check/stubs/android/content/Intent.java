package android.content;

import android.net.Uri;
import java.util.HashMap;
import java.util.Map;

public class Intent {
    public static final String ACTION_SEND = "android.intent.action.SEND";
    public static final String ACTION_BATTERY_CHANGED = "android.intent.action.BATTERY_CHANGED";
    public static final String EXTRA_TEXT = "android.intent.extra.TEXT";

    final String what;
    final Map<String, Object> extras = new HashMap<>();

    public Intent(String action) {
        what = action;
    }

    public Intent(String action, Uri data) {
        what = action + " " + data;
    }

    public Intent(Context context, Class<?> activity) {
        what = activity.getName();
    }

    public static Intent createChooser(Intent target, CharSequence title) {
        return target;
    }

    public Intent setType(String type) {
        return this;
    }

    public Intent putExtra(String name, String value) {
        extras.put(name, value);
        return this;
    }

    public Intent putExtra(String name, int value) {
        extras.put(name, value);
        return this;
    }

    public int getIntExtra(String name, int otherwise) {
        return (Integer) extras.getOrDefault(name, otherwise);
    }

    @Override
    public String toString() {
        return what;
    }
}
