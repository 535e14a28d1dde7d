plugins {
    id("com.android.application")
}

android {
    namespace = "org.visavis.demo"
    compileSdk = 35

    defaultConfig {
        applicationId = "org.visavis.demo"
        minSdk = 29
        targetSdk = 35
        versionCode = 1
        versionName = "0.1.0"
    }
    buildTypes {
        release {
            isMinifyEnabled = true
            proguardFiles(getDefaultProguardFile("proguard-android-optimize.txt"))
            signingConfig = signingConfigs["debug"] // sideloading only
        }
    }
    compileOptions {
        sourceCompatibility = JavaVersion.VERSION_11
        targetCompatibility = JavaVersion.VERSION_11
    }
    // Read where they lie in the APK: stored, not compressed.
    androidResources { noCompress += listOf("safetensors", "wav") }
    sourceSets["main"].assets.srcDir(layout.buildDirectory.dir("sampleAssets"))
}

dependencies {
    implementation(project(":visavis"))
    compileOnly("androidx.annotation:annotation:1.9.1")
}

// The bundle and the sample conversation, from the repository.
val sampleAssets by tasks.registering(Copy::class) {
    from("../../models") { include("visavis-room-i8.safetensors") }
    from("../../samples") { include("agent.wav", "user.wav") }
    into(layout.buildDirectory.dir("sampleAssets"))
}

// Body, shaders and colours of the live page; takes Node.js.
val stageAsset by tasks.registering(Exec::class) {
    dependsOn(sampleAssets) // into the same folder, after it
    val model = file("../../models/visavis-room-i8.safetensors")
    val stage = layout.buildDirectory.dir("sampleAssets").get().asFile.resolve("stage.bin")
    inputs.files(file("../apk/stage.mjs"), fileTree("../../tools/src/export/viewer/stage"), model)
    outputs.file(stage)
    commandLine("node", "../apk/stage.mjs", model.path, stage.path)
}

tasks.named("preBuild") { dependsOn(stageAsset) }
