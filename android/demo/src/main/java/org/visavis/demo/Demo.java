package org.visavis.demo;

import android.content.Context;
import android.content.res.AssetFileDescriptor;
import android.content.res.AssetManager;
import java.io.FileNotFoundException;
import java.io.IOException;
import java.io.InputStream;
import org.visavis.Visavis;
import org.visavis.VisavisEngine;

/**
 * What outlives an activity: the engine, the conversation, a measurement. An activity that is made anew, as after a change of the configuration, finds it
 * as it was; it ends when the last activity that attached itself is finished. Methods are for the main thread unless they say otherwise.
 */
final class Demo {
    static final String BUNDLE = "visavis-room-i8.safetensors";
    private static Demo current;

    final Life life = new Life();
    final Loading loading = new Loading();
    final MicrophoneState microphone = new MicrophoneState();
    private final AssetManager assets;
    private int owners;
    private boolean closed;
    private Thread loader;
    private volatile StageData stage;
    private volatile Wav agent;
    private volatile Wav user;
    private volatile VisavisEngine engine;
    private volatile Motion motion;
    private volatile Measurement measurement;

    private Demo(AssetManager assets) {
        this.assets = assets;
    }

    /** The app's one; the first call starts to load. */
    static Demo attach(Context context) {
        if (current == null) {
            current = new Demo(context.getApplicationContext().getAssets());
            current.load();
        }
        current.owners++;
        return current;
    }

    /** @param finished the activity does not come back by itself */
    void detach(boolean finished) {
        owners--;
        if (finished && owners == 0) {
            current = null;
            close();
        }
    }

    /** Null until it is loaded. */
    Motion motion() {
        return motion;
    }

    /** Null until it is loaded. */
    StageData stage() {
        return stage;
    }

    /** Null until it is loaded. */
    VisavisEngine engine() {
        return engine;
    }

    /** Null before the first one. */
    Measurement measurement() {
        return measurement;
    }

    /** Starts a measurement of so many minutes of conversation, unless one is under way: there is never more than one. */
    Measurement measure(int minutes, Heat heat) {
        Measurement under = measurement;
        if (under == null || !under.isAlive()) {
            under = new Measurement(engine, agent, user, minutes, heat, life);
            measurement = under;
            under.start();
        }
        return under;
    }

    /** After a failure: everything from the start. */
    void again() {
        stop();
        life.again();
        load();
    }

    private void load() {
        Thread thread = new Thread("visavis-load") {
            @Override
            public void run() {
                loadAll();
            }
        };
        loader = thread;
        thread.start();
    }

    private void loadAll() {
        String doing = "loading the library";
        VisavisEngine made = null;
        try {
            loading.step("Library", 0.02f);
            Visavis.version();
            doing = "loading the voices";
            loading.step("The agent's voice", 0.07f);
            Wav first = voice("agent.wav");
            loading.step("The user's voice", 0.12f);
            Wav second = voice("user.wav");
            doing = "loading the stage";
            loading.step("Stage", 0.3f);
            StageData body = StageData.read(assets.open(StageData.ASSET));
            doing = "loading the model";
            loading.step("Model", 0.7f);
            readModel();
            loading.step("Engine", 0.85f);
            made = VisavisEngine.fromAsset(assets, BUNDLE);
            doing = "starting the conversation";
            loading.step("First blocks", 1);
            begin(body, made, first, second, new Motion(made, first, second, life, microphone));
        } catch (IOException | RuntimeException | Error e) {
            if (made != null) {
                made.close();
            }
            life.failed(Failure.of(doing, e));
        }
    }

    /** On the loading thread: the conversation begins, unless the app was closed meanwhile. */
    private synchronized void begin(StageData body, VisavisEngine made, Wav first, Wav second, Motion begun) {
        if (closed) {
            begun.discard();
            made.close();
            return;
        }
        stage = body;
        engine = made;
        agent = first;
        user = second;
        motion = begun;
        loading.finished();
        life.loaded();
        begun.start();
    }

    private Wav voice(String name) throws IOException {
        AssetFileDescriptor file = assets.openFd(name);
        return Wav.read(loading.watched(file.createInputStream(), file.getLength()), name);
    }

    private void readModel() throws IOException {
        try (AssetFileDescriptor file = assets.openFd(BUNDLE);
                InputStream in = loading.watched(file.createInputStream(), file.getLength())) {
            Loading.readThrough(in);
        } catch (FileNotFoundException e) {
            throw new IOException(BUNDLE + " is not in the APK, or compressed in it", e);
        }
    }

    /** Ends the threads that are under way; those that compute come to their end within a block. */
    private synchronized void stop() {
        if (measurement != null) {
            measurement.cancel("the app was closed");
        }
        if (motion != null) {
            motion.finish();
            motion = null;
        }
        if (loader != null) {
            loader.interrupt();
            loader = null;
        }
        if (engine != null) {
            engine.close(); // sessions live on until their threads end
            engine = null;
        }
    }

    private synchronized void close() {
        closed = true;
        stop();
    }
}
