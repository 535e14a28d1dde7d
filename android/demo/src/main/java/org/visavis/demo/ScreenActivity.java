package org.visavis.demo;

import android.app.Activity;
import android.content.ClipData;
import android.content.ClipboardManager;
import android.content.Context;
import android.content.Intent;
import android.os.Build;
import android.os.Bundle;
import android.util.Log;
import android.view.View;
import java.util.Locale;

/** An activity that shows one screen at a time and brings it up to date while it is started: loading, what failed, or its own. */
abstract class ScreenActivity extends Activity {
    static final String TAG = "visavis";
    private static final long TICK = 100;

    Demo demo;
    private RootView root;
    private Screen screen;
    private Object shown;
    private boolean started;
    private boolean resumed;

    private final Runnable tick = new Runnable() {
        @Override
        public void run() {
            if (started) {
                refresh();
                root.postDelayed(this, TICK);
            }
        }
    };

    @Override
    protected void onCreate(Bundle state) {
        super.onCreate(state);
        demo = Demo.attach(this);
        root = new RootView(this);
        setContentView(root);
    }

    @Override
    protected void onStart() {
        super.onStart();
        started = true;
        tick.run();
    }

    @Override
    protected void onResume() {
        super.onResume();
        resumed = true;
        if (screen != null) {
            screen.shown(true);
        }
    }

    @Override
    protected void onPause() {
        super.onPause();
        resumed = false;
        if (screen != null) {
            screen.shown(false);
        }
    }

    @Override
    protected void onStop() {
        super.onStop();
        started = false;
    }

    @Override
    protected void onDestroy() {
        super.onDestroy();
        demo.detach(isFinishing());
    }

    /** What its own screen is made for: another object, another screen. Null while there is nothing to show yet. */
    abstract Object subject();

    /** The activity's own screen, once everything is loaded. */
    abstract Screen screen();

    void refresh() {
        final Failure failure = demo.life.failure();
        Object subject = failure != null ? failure : demo.life.isLoaded() ? subject() : null;
        if (screen == null || subject != shown) {
            shown = subject;
            if (screen != null) {
                screen.shown(false);
            }
            if (failure != null) {
                Log.e(TAG, failure.toString());
                screen = failureScreen(failure);
            } else {
                screen = subject == null ? new LoadingScreen(this, demo.loading) : screen();
            }
            root.show(screen.view());
            screen.shown(resumed);
        }
        screen.refresh(System.nanoTime());
    }

    private Screen failureScreen(final Failure failure) {
        return new FailureScreen(this, failure, new View.OnClickListener() {
            @Override
            public void onClick(View clicked) {
                demo.again();
            }
        }, new View.OnClickListener() {
            @Override
            public void onClick(View clicked) {
                share(header() + "\n\n" + failure);
            }
        });
    }

    /** The device, the system, the app. */
    static String header() {
        return String.format(Locale.ROOT, "Visavis demo %s\n%s %s, Android %s (API %d), %d cores", version(), Build.MANUFACTURER, Build.MODEL,
                Build.VERSION.RELEASE, Build.VERSION.SDK_INT, Runtime.getRuntime().availableProcessors());
    }

    private static String version() {
        try {
            return org.visavis.Visavis.version();
        } catch (LinkageError e) {
            return "without its library";
        }
    }

    /** To another app, to the clipboard (a headset may have no app to share with), and to the log. */
    void share(String text) {
        Log.i(TAG, text);
        ClipboardManager clipboard = (ClipboardManager) getSystemService(Context.CLIPBOARD_SERVICE);
        clipboard.setPrimaryClip(ClipData.newPlainText(getString(R.string.app_name), text));
        Intent send = new Intent(Intent.ACTION_SEND).setType("text/plain").putExtra(Intent.EXTRA_TEXT, text);
        startActivity(Intent.createChooser(send, getString(R.string.share)));
    }
}
