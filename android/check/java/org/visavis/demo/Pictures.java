package org.visavis.demo;

import android.app.StandInScreen;
import android.content.Intent;
import android.content.StandInContext;
import android.content.res.StandInAssets;
import android.graphics.StandInPicture;
import android.opengl.StandInGl;
import android.os.StandInLooper;
import android.view.StandInWindow;
import android.view.View;
import java.awt.image.BufferedImage;
import java.io.File;
import java.nio.file.Files;
import java.nio.file.Path;
import javax.imageio.ImageIO;

/**
 * The app's screens as pictures, drawn on this machine: BUNDLE FOLDER. Text, layout and drawing are the app's own; letters and widgets are stand-ins.
 * Runs in the repository's root.
 */
public final class Pictures {
    private static Path folder;

    private Pictures() {}

    public static void main(String[] args) throws Exception {
        folder = Path.of(args[1]);
        Files.createDirectories(folder);
        Path assets = Files.createTempDirectory("visavis");
        try {
            Files.createSymbolicLink(assets.resolve(Demo.BUNDLE), Path.of(args[0]).toAbsolutePath());
            for (String name : new String[] {"agent.wav", "user.wav"}) {
                Files.copy(Path.of("samples", name), assets.resolve(name));
            }
            Files.copy(Path.of(System.getProperty("visavis.stage")), assets.resolve(StageData.ASSET));
            StandInContext.assets = StandInAssets.folder(assets.toFile());
            take(assets);
        } catch (AssertionError e) {
            e.printStackTrace();
            System.exit(1);
        } finally {
            for (File file : assets.toFile().listFiles()) {
                Files.delete(file.toPath());
            }
            Files.delete(assets);
        }
        System.exit(0);
    }

    private static void take(Path assets) throws Exception {
        StandInAssets.delay = 30;
        DemoActivity activity = StandInScreen.open(new DemoActivity(), new Intent("main"), false);
        StandInLooper.run(1500);
        picture(activity, "loading-panel", 1280, 800, 0);
        StandInAssets.delay = 0;
        // A panel, a phone upright and on its side, a tablet.
        StandInScreen.close(activity);
        activity = StandInScreen.open(new DemoActivity(), new Intent("main"), false);
        ActivityTest.until(activity, "x real time");
        activity.demo.motion().moveUser(-0.7f, 1.3f);
        StandInLooper.run(2500);
        picture(activity, "stage-panel", 1280, 800, 0);
        StandInContext.permitted = false;
        activity.microphone();
        StandInScreen.answer(activity, false, false);
        activity.demo.motion().moveUser(0.8f, 1.6f);
        activity.demo.motion().setGazeStep(91);
        StandInLooper.run(2500);
        StandInAssets.density(2.75f);
        activity = StandInScreen.change(activity, new DemoActivity());
        StandInLooper.run(300);
        picture(activity, "stage-phone-upright", 1080, 2340, 80);
        activity = StandInScreen.change(activity, new DemoActivity());
        StandInLooper.run(300);
        picture(activity, "stage-phone-on-its-side", 2340, 1080, 60);
        StandInAssets.density(2);
        activity = StandInScreen.change(activity, new DemoActivity());
        StandInLooper.run(300);
        picture(activity, "stage-tablet", 1600, 2560, 48);
        StandInAssets.density(1);
        MeasureActivity measure = StandInScreen.open(new MeasureActivity(), new Intent("measure").putExtra("minutes", 1), false);
        ActivityTest.until(measure, "minute 1 of 1");
        StandInLooper.run(1500);
        picture(measure, "measure-panel", 1280, 800, 0);
        StandInScreen.close(measure);
        StandInScreen.close(activity);
        Files.delete(assets.resolve(Demo.BUNDLE));
        Files.write(assets.resolve(Demo.BUNDLE), new byte[100]);
        StandInAssets.density(2.75f);
        activity = StandInScreen.open(new DemoActivity(), new Intent("main"), false);
        ActivityTest.until(activity, "Failed");
        picture(activity, "failure-phone-upright", 1080, 2340, 80);
        StandInScreen.close(activity);
    }

    private static void picture(ScreenActivity activity, String name, int width, int height, int bars) throws Exception {
        View content = StandInScreen.content(activity);
        StandInWindow.insets(content, bars, bars, 0);
        StandInWindow.lay(content, width, height);
        activity.refresh();
        BufferedImage image = StandInPicture.of(content, width, height);
        if (name.startsWith("stage") && StandInGl.there()) {
            dressed(image, name);
        }
        ImageIO.write(image, "png", folder.resolve(name + ".png").toFile());
        System.out.println(name + ": " + width + " x " + height);
    }

    /** The agent's shirt and skin are in the picture, and the user's ring. */
    private static void dressed(BufferedImage image, String name) {
        int shirt = 0;
        int skin = 0;
        int ring = 0;
        for (int y = 0; y < image.getHeight(); y++) {
            for (int x = 0; x < image.getWidth(); x++) {
                int pixel = image.getRGB(x, y);
                int red = pixel >> 16 & 255;
                int green = pixel >> 8 & 255;
                int blue = pixel & 255;
                shirt += blue > red + 50 && green > red + 15 && blue > 100 && blue < 210 ? 1 : 0;
                skin += red > green + 25 && green > blue + 10 && red > 140 ? 1 : 0;
                ring += red > green + 40 && blue > red + 15 ? 1 : 0;
            }
        }
        double share = 1.0 / image.getWidth() / image.getHeight();
        System.out.printf("  shirt %.2f %%, skin %.2f %%, ring %.2f %%%n", 100 * share * shirt, 100 * share * skin, 100 * share * ring);
        if (share * shirt < 0.002 || share * skin < 0.0003 || share * ring < 0.0001) {
            throw new AssertionError(name + ": the agent or the user is not in the picture");
        }
    }
}
