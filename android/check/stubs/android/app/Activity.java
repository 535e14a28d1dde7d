package android.app;

import android.content.Context;
import android.os.Bundle;
import android.view.View;

public class Activity extends Context {
    protected void onCreate(Bundle state) {}

    protected void onDestroy() {}

    public void onRequestPermissionsResult(int code, String[] permissions, int[] results) {}

    public final void requestPermissions(String[] permissions, int code) {}

    public void setContentView(View view) {}

    public final void runOnUiThread(Runnable action) {}

    public void finish() {}
}
