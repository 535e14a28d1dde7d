plugins {
    id("com.android.library")
}

android {
    namespace = "org.visavis"
    compileSdk = 35
    ndkVersion = "28.0.13004108" // 16 KiB pages by default from r28 on

    defaultConfig {
        minSdk = 29
        consumerProguardFiles("consumer-rules.pro")
        ndk { abiFilters += "arm64-v8a" }
    }
    compileOptions {
        sourceCompatibility = JavaVersion.VERSION_11
        targetCompatibility = JavaVersion.VERSION_11
    }
    sourceSets["main"].jniLibs.srcDir(layout.buildDirectory.dir("jniLibs"))
}

dependencies {
    // Annotations only; nothing of it is needed at run time.
    compileOnly("androidx.annotation:annotation:1.9.1")
}

// The native library: cargo install cargo-ndk; rustup target add aarch64-linux-android
val cargoNdk by tasks.registering(Exec::class) {
    workingDir = file("../native")
    inputs.files(fileTree("../native") { include("**/*.rs", "**/Cargo.toml") })
    inputs.files(fileTree("../microphone") { include("**/*.rs", "**/Cargo.toml") })
    inputs.files(fileTree("../../src") { include("**/*.rs") }, file("../../Cargo.toml"), file("../../Cargo.lock"))
    outputs.dir(layout.buildDirectory.dir("jniLibs"))
    environment("ANDROID_NDK_HOME", android.ndkDirectory.path)
    commandLine(
        "cargo", "ndk", "-t", "arm64-v8a", "-P", "29", "-o", layout.buildDirectory.dir("jniLibs").get().asFile.path,
        "build", "--profile", "dist",
    )
}

tasks.named("preBuild") { dependsOn(cargoNdk) }
