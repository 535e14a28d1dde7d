package android.content;

public class ClipboardManager extends android.text.ClipboardManager {
    ClipData data;

    ClipboardManager() {}

    public void setPrimaryClip(ClipData clip) {
        data = clip;
    }
}
