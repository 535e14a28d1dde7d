package android.app;

import android.content.Intent;
import android.content.StandInContext;
import android.content.pm.PackageManager;
import android.os.Bundle;
import android.view.View;

/** The system's side of an activity: its lifecycle, its window, its permissions. */
public final class StandInScreen {
    private StandInScreen() {}

    public static <A extends Activity> A open(A activity, Intent intent, boolean anew) {
        activity.intent = intent;
        activity.onCreate(anew ? new Bundle() : null);
        activity.onStart();
        activity.onResume();
        return activity;
    }

    public static void leave(Activity activity) {
        activity.onPause();
        activity.onStop();
    }

    public static void comeBack(Activity activity) {
        activity.onStart();
        activity.onResume();
    }

    public static void close(Activity activity) {
        activity.finishing = true;
        leave(activity);
        activity.onDestroy();
    }

    /** A change that makes the activity anew. */
    public static <A extends Activity> A change(A old, A anew) {
        old.changing = true;
        leave(old);
        old.onDestroy();
        return open(anew, old.intent, true);
    }

    public static View content(Activity activity) {
        return activity.content;
    }

    public static boolean asked(Activity activity) {
        return activity.asked != null;
    }

    public static void answer(Activity activity, boolean granted, boolean rationale) {
        String[] asked = activity.asked;
        activity.asked = null;
        activity.rationale = rationale;
        StandInContext.permitted = granted;
        activity.onRequestPermissionsResult(1, asked, new int[] {granted ? PackageManager.PERMISSION_GRANTED : PackageManager.PERMISSION_DENIED});
    }
}
