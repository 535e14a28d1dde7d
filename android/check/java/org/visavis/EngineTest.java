package org.visavis;

import static org.visavis.Check.bundle;
import static org.visavis.Check.engine;
import static org.visavis.Check.equal;
import static org.visavis.Check.isTrue;

import android.content.res.StandInAssets;
import java.io.File;
import java.io.OutputStream;
import java.nio.ByteBuffer;
import java.nio.file.Files;
import java.util.Arrays;

/** Loading, from each place, and what an engine tells. */
final class EngineTest {
    private EngineTest() {}

    static void testEachWayOfLoading() throws Exception {
        byte[] bytes = Files.readAllBytes(bundle.toPath());
        ByteBuffer direct = ByteBuffer.allocateDirect(bytes.length + 10);
        direct.position(3);
        direct.put(bytes);
        direct.flip().position(3);
        try (VisavisEngine file = engine();
                VisavisEngine array = VisavisEngine.fromBytes(bytes);
                VisavisEngine buffer = VisavisEngine.fromBytes(direct)) {
            equal(file.name(), array.name());
            equal(file.name(), buffer.name());
            equal(3, direct.position());
        }
    }

    static void testAssetInsideAnotherFile() throws Exception {
        byte[] bytes = Files.readAllBytes(bundle.toPath());
        File apk = File.createTempFile("visavis", ".apk");
        try {
            try (OutputStream out = Files.newOutputStream(apk.toPath())) {
                out.write(new byte[4099]);
                out.write(bytes);
                out.write(new byte[50]);
            }
            try (VisavisEngine engine = VisavisEngine.fromAsset(StandInAssets.inside(apk, 4099, bytes.length), "model.safetensors")) {
                isTrue(engine.skeleton().size() > 0, "joints");
            }
            Check.throwsWith(BundleException.Corrupt.class, "bundle asset",
                    () -> VisavisEngine.fromAsset(StandInAssets.inside(apk, 4098, bytes.length), "model.safetensors"));
            Check.throwsWith(IllegalArgumentException.class, "the file has",
                    () -> VisavisEngine.fromAsset(StandInAssets.inside(apk, 4099, bytes.length + 51), "model.safetensors"));
        } finally {
            isTrue(apk.delete(), "temporary file");
        }
    }

    static void testSkeletonAndOpenXr() throws Exception {
        try (VisavisEngine engine = engine()) {
            Skeleton skeleton = engine.skeleton();
            equal("hips", skeleton.names().get(0));
            equal(-1, skeleton.parent(0));
            for (int j = 1; j < skeleton.size(); j++) {
                isTrue(skeleton.parent(j) >= 0 && skeleton.parent(j) < j, "parents come first");
                int joint = OpenXrBody.META_FULL_BODY.jointOf(skeleton.names().get(j));
                isTrue(joint > 0, skeleton.names().get(j));
                equal(skeleton.names().get(j), OpenXrBody.META_FULL_BODY.follows(joint));
            }
            isTrue(skeleton.restOffset(0, 1) > 0.5f, "the hips' height");
            int[] body = skeleton.forOpenXr(OpenXrBody.FB_BODY_TRACKING);
            equal(70, body.length);
            equal(-1, body[0]);
            equal(skeleton.indexOf("leftHand"), body[43]);
            equal("LEFT_HAND_LITTLE_TIP", OpenXrBody.FB_BODY_TRACKING.jointName(43));
            equal(84, skeleton.forOpenXr(OpenXrBody.META_FULL_BODY).length);
            equal(-1, OpenXrBody.FB_BODY_TRACKING.jointOf("leftFoot"));
            equal(-1, OpenXrBody.META_FULL_BODY.jointOf("jaw"));
            Check.throwsWith(IndexOutOfBoundsException.class, "70", () -> OpenXrBody.FB_BODY_TRACKING.jointName(70));
        }
    }

    static void testDamagedBundles() throws Exception {
        byte[] bytes = Files.readAllBytes(bundle.toPath());
        int before = Native.openObjects()[0];
        for (int length : new int[] {0, 1, 7, 8, 9, 100, bytes.length / 2, bytes.length - 1}) {
            Check.throwsWith(BundleException.Corrupt.class, "bundle in memory", () -> VisavisEngine.fromBytes(Arrays.copyOf(bytes, length)));
        }
        byte[] noise = new byte[100_000];
        new java.util.Random(5).nextBytes(noise);
        Check.throwsWith(BundleException.Corrupt.class, "bundle in memory", () -> VisavisEngine.fromBytes(noise));
        byte[] nan = bytes.clone();
        Arrays.fill(nan, nan.length - 4, nan.length, (byte) 0xff);
        Check.throwsWith(BundleException.Corrupt.class, "element", () -> VisavisEngine.fromBytes(nan));
        byte[] version = new String(bytes, java.nio.charset.StandardCharsets.ISO_8859_1)
                .replaceFirst("\\\\\"format\\\\\": ?[0-9]", "\\\\\"format\\\\\":9")
                .getBytes(java.nio.charset.StandardCharsets.ISO_8859_1);
        if (version.length == bytes.length) {
            Check.throwsWith(BundleException.Version.class, "format 9", () -> VisavisEngine.fromBytes(version));
        }
        byte[] foreign = "\u0002\0\0\0\0\0\0\0{}".getBytes(java.nio.charset.StandardCharsets.ISO_8859_1);
        Check.throwsWith(BundleException.Invalid.class, "not a Visavis bundle", () -> VisavisEngine.fromBytes(foreign));
        Check.throwsWith(java.io.IOException.class, "nowhere", () -> VisavisEngine.fromFile(new File("/nowhere/model.safetensors")));
        equal(before, Native.openObjects()[0]);
    }
}
