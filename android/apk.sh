#!/usr/bin/env bash
# The demo as an APK to sideload, from the sources: android/apk.sh -> out/android/demo.apk
#
# Needs Debian bookworm and Rust; no Gradle, no Android SDK. What is missing is installed (android/apk/tools.sh, as root once).
# The native library is built with Google's NDK where ANDROID_NDK_HOME names one (r28 or newer) and rustup has the target
# aarch64-linux-android. Else with the stand-in NDK of ../shared/android, in loud words: such an APK is for checks, not for devices.
#
#   KEYSTORE, KEYSTORE_PASS, KEY_ALIAS   a key of yours (default: the SDK's debug key of this user, or a debug key made once)
#   VISAVIS_SO                           a library that was built before
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export LC_ALL=C
tools=$(android/apk/tools.sh)
kit=$(cd .. && pwd)/shared/android
out=out/android
mkdir -p "$out"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
gradle() { sed -nE "s/^ *$1 = \"?([A-Za-z0-9.]+)\"?.*/\1/p" android/demo/build.gradle.kts | head -n 1; }

echo '-- native library'
standins=''
if [ -n "${VISAVIS_SO:-}" ]; then
  so=$VISAVIS_SO
  standins=${VISAVIS_SO_STANDINS:-}
elif [ -n "${ANDROID_NDK_HOME:-}" ] && rustup target list --installed 2>/dev/null | grep -qx aarch64-linux-android; then
  linker=$(echo "$ANDROID_NDK_HOME"/toolchains/llvm/prebuilt/*/bin/aarch64-linux-android29-clang)
  [ -x "$linker" ] || { echo "no compiler for API 29 in $ANDROID_NDK_HOME: it takes NDK r28 or newer" >&2; exit 1; }
  CARGO_TARGET_AARCH64_LINUX_ANDROID_LINKER=$linker CARGO_TARGET_AARCH64_LINUX_ANDROID_RUSTFLAGS='-Clink-arg=-Wl,-z,max-page-size=16384' \
    cargo build -p visavis-android --profile dist --target aarch64-linux-android
  so=${CARGO_TARGET_DIR:-target}/aarch64-linux-android/dist/libvisavis_jni.so
elif [ -x "$kit/build.sh" ]; then
  so=$("$kit/build.sh" android/native --profile dist)
  standins=yes
else
  echo "no NDK: set ANDROID_NDK_HOME to Google's NDK r28 or newer and run 'rustup target add aarch64-linux-android'" >&2
  exit 1
fi

echo '-- resources and manifest (aapt2)'
# Gradle does these two: its namespace becomes the package, and libraries are mapped where they lie in the APK.
sed -e "s|<manifest |<manifest package=\"$(gradle namespace)\" |" -e 's|<application$|<application android:extractNativeLibs="false"|' \
  android/demo/src/main/AndroidManifest.xml >"$work/AndroidManifest.xml"
grep -q extractNativeLibs "$work/AndroidManifest.xml"
aapt2 compile --dir android/demo/src/main/res -o "$work/resources.zip"
aapt2 link -I /usr/share/android-framework-res/framework-res.apk --manifest "$work/AndroidManifest.xml" --rename-manifest-package "$(gradle applicationId)" \
  --min-sdk-version "$(gradle minSdk)" --target-sdk-version "$(gradle targetSdk)" --version-code "$(gradle versionCode)" \
  --version-name "$(gradle versionName)" --java "$work/generated" --proguard "$work/manifest.pro" -o "$work/base.apk" "$work/resources.zip"

echo '-- classes, against the stand-ins that agree with API 29'
sources() { find "$@" -name '*.java' | sort; }
mkdir "$work"/{standins,classes}
# shellcheck disable=SC2046
javac --release 11 -proc:none -Xlint:all -Werror -d "$work/standins" $(sources android/check/stubs | grep -v /visavis/demo/R.java)
# The dexer reads class files of Java 8; with that release nothing is called through invokedynamic but lambdas, of which there are none.
# shellcheck disable=SC2046
javac --release 8 -g:source,lines -proc:none -Xlint:all,-options -Werror -cp "$work/standins" -d "$work/classes" \
  $(sources "$work/generated" android/visavis/src/main/java android/demo/src/main/java)
android/apk/api.py standins "$tools/api-29.txt" "$work/standins"
android/apk/api.py references "$tools/api-29.txt" "$work/classes"
java -jar "$tools/dx.jar" --dex --min-sdk-version=28 --output="$work/classes.dex" "$work/classes"

echo '-- the stage: body, shaders and colours of the live page'
node android/apk/stage.mjs models/visavis-room-i8.safetensors "$work/stage.bin"

echo '-- pack and sign'
repository=("lib/arm64-v8a/libvisavis_jni.so=$so" "classes.dex=$work/classes.dex" "assets/visavis-room-i8.safetensors=models/visavis-room-i8.safetensors"
  "assets/stage.bin=$work/stage.bin" assets/agent.wav=samples/agent.wav assets/user.wav=samples/user.wav)
python3 android/apk/pack.py "$work/base.apk" "$work/unsigned.apk" "${repository[@]}"
pass=${KEYSTORE_PASS:-android} alias=${KEY_ALIAS:-androiddebugkey}
if [ -z "${KEYSTORE:-}" ]; then
  KEYSTORE=$HOME/.android/debug.keystore
  if [ ! -f "$KEYSTORE" ]; then
    KEYSTORE=$tools/debug.keystore
    [ -f "$KEYSTORE" ] || keytool -genkeypair -keystore "$KEYSTORE" -storetype PKCS12 -storepass android -alias androiddebugkey -keyalg RSA -keysize 2048 \
      -validity 10950 -dname 'CN=Android Debug,O=Android,C=US' 2>/dev/null
  fi
fi
export pass
apksigner sign --ks "$KEYSTORE" --ks-pass env:pass --ks-key-alias "$alias" --min-sdk-version 29 --v1-signing-enabled false --v2-signing-enabled true \
  --v3-signing-enabled true --v4-signing-enabled false --out "$work/demo.apk" "$work/unsigned.apk"
cp "$work/classes.dex" "$work/manifest.pro" "$out"
mv "$work/demo.apk" "$out/demo.apk"
sha256sum "$out/demo.apk"
if [ -n "$standins" ]; then
  cat >&2 <<'LOUD'

  ############################################################################################
  #  NOT FOR DEVICES. The native library in this APK was linked against stand-ins of the      #
  #  NDK's libraries, not against Google's NDK. It proves that everything fits together;      #
  #  whether it loads on a device nobody has tried, and nobody should rely on it.             #
  #  For an APK to use: ANDROID_NDK_HOME=<NDK r28 or newer> android/apk.sh, after             #
  #  rustup target add aarch64-linux-android                                                  #
  ############################################################################################
LOUD
fi
echo "$out/demo.apk: $(stat -c %s "$out/demo.apk") bytes"
