#!/usr/bin/env bash
# Checks of the APK, minutes: android/apk_check.sh
#
# Builds it twice (same bytes), reads it with the public tools, holds it against the Gradle project and API 29's list, and runs the Java tests of
# library and demo on its dex; a fault planted in the dex must fail. Skipped, in words, where neither an NDK nor ../shared/android is there.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export LC_ALL=C RUST_BACKTRACE=0
kit=$(cd .. && pwd)/shared/android
if [ -z "${VISAVIS_SO:-}${ANDROID_NDK_HOME:-}" ] && [ ! -x "$kit/build.sh" ]; then
  echo "skipped: there is no NDK and no $kit; no APK was made"
  exit 0
fi
tools=$(android/apk/tools.sh)
out=out/android
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
target=$(cargo metadata --no-deps --format-version 1 | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')

echo '-- APK: twice the same bytes'
android/apk.sh
cp "$out/demo.apk" "$work/first.apk"
library=$work/libvisavis_jni.so
python3 -c 'import sys, zipfile; open(sys.argv[2], "wb").write(zipfile.ZipFile(sys.argv[1]).read("lib/arm64-v8a/libvisavis_jni.so"))' "$out/demo.apk" "$library"
VISAVIS_SO=$library android/apk.sh >"$work/log" || { cat "$work/log"; exit 1; }
cmp "$work/first.apk" "$out/demo.apk"

echo '-- what public tools say'
apksigner verify --verbose --min-sdk-version 29 "$out/demo.apk" | grep -E '^(Verified using v[23]|Verifies)'
apksigner verify --min-sdk-version 24 --max-sdk-version 27 "$out/demo.apk" # the v2 signature by itself
zipalign -c -p 4 "$out/demo.apk"
aapt dump badging "$out/demo.apk" 2>/dev/null | grep -E '^(package|sdkVersion|targetSdk|uses-permission|application-label:|launchable|native-code)'
android/apk/checkapk.py "$out/demo.apk" android
if /usr/bin/python3 -c 'import androguard' 2>/dev/null; then
  /usr/bin/python3 android/apk/guard.py "$out/demo.apk"
else
  echo 'skipped: androguard is not installed (apt-get install --no-install-recommends androguard, 600 MB)'
fi

echo '-- the same sources at the level that Gradle compiles for, against API 29'
compile() { # compile NAME CLASSPATH LEVEL FOLDER...
  local name=$1 path=$2 level=$3
  shift 3
  # shellcheck disable=SC2046
  javac --release "$level" -XDstringConcat=inline -proc:none -Xlint:all,-options -Werror ${path:+-cp "$path"} -d "$work/$name" $(find "$@" -name '*.java')
}
compile standins '' 11 android/check/stubs
compile classes "$work/standins" 11 android/visavis/src/main/java android/demo/src/main/java
mkdir -p "$work/resources/org/visavis/demo"
cp "$work"/standins/org/visavis/demo/R*.class "$work/resources/org/visavis/demo"
android/apk/api.py references "$tools/api-29.txt" "$work/classes" "$work/resources"
diff <(grep -o 'string name="[a-z_]*"' android/demo/src/main/res/values/strings.xml | cut -d'"' -f2 | sort) \
  <(grep -oE 'int [a-z_]+' android/check/stubs/org/visavis/demo/R.java | cut -d' ' -f2 | sort)

echo '-- the tests on the dex of the APK, and on the class files: the same motion'
nice cargo build --quiet --release -p visavis-android
compile tests "$work/standins:$work/classes" 11 android/check/java
android/apk/rundex.sh "$out/classes.dex" "$target/release" | tee "$work/dex.log"
java -Djava.library.path="$target/release" -cp "$work/classes:$work/standins:$work/tests" org.visavis.Check tests/goldens/tiny.safetensors 20 6 >"$work/host.log" 2>&1
grep -q '^digest ' "$work/host.log"
diff <(grep '^digest ' "$work/host.log") <(grep '^digest ' "$work/dex.log")

echo '-- pictures of the screens, the stage by OpenGL ES of this machine'
if [ ! -f /usr/include/EGL/egl.h ] || [ -z "$(ls /usr/lib/*/dri/swrast_dri.so 2>/dev/null)" ]; then
  export DEBIAN_FRONTEND=noninteractive
  apt-get -qq install -y --no-install-recommends gcc libc6-dev libegl-dev libgles-dev libegl1 libgles2 libgl1-mesa-dri >"$work/mesa.log" 2>&1 || true
fi
gl=''
java=$(dirname "$(dirname "$(realpath "$(command -v javac)")")")
if cc -O1 -Wall -Werror -shared -fPIC -I"$java/include" -I"$java/include/linux" -o "$work/libgl.so" android/check/gl.c -lEGL -lGLESv2 2>"$work/gl.log"; then
  gl=$work/libgl.so
else
  echo 'skipped: no OpenGL ES here; the pictures are without the stage'
fi
python3 -c 'import sys, zipfile; zipfile.ZipFile(sys.argv[1]).extract("assets/stage.bin", sys.argv[2])' "$out/demo.apk" "$work"
java -ea -Djava.awt.headless=true -Djava.library.path="$target/release" -Dvisavis.gl="$gl" -Dvisavis.stage="$work/assets/stage.bin" \
  -Dvisavis.strings=android/demo/src/main/res/values/strings.xml -cp "$work/classes:$work/standins:$work/tests" org.visavis.demo.Pictures \
  models/visavis-room-i8.safetensors "$out/pictures" >"$work/pictures.log" 2>&1 || { tail -20 "$work/pictures.log"; exit 1; }
grep -E '^(loading|stage|measure|failure|  shirt)' "$work/pictures.log"

echo '-- a fault planted in the dex is found'
baksmali d "$out/classes.dex" -o "$work/smali"
python3 - "$work/smali/org/visavis/FrameLayout.smali" <<'FAULT'
import re, sys
# A joint's place in a frame, one float further.
path = sys.argv[1]
text = open(path).read()
start = text.index(".method public joint(")
faulty, planted = re.subn(r"(add-int/lit8 \w+, \w+, )0xa\b", r"\g<1>0xb", text[start:], count=1)
if planted != 1:
    sys.exit("nothing was planted")
open(path, "w").write(text[:start] + faulty)
FAULT
smali a "$work/smali" -a 29 -o "$work/fault.dex"
if android/apk/rundex.sh "$work/fault.dex" "$target/release" org.visavis.Check >"$work/fault.log" 2>&1; then
  echo 'the tests passed on a dex with a fault' >&2
  exit 1
fi
grep -m 1 FAILED "$work/fault.log"

echo '-- what ProGuard keeps with the rules of the library'
android/apk/keeprules.sh "$out/manifest.pro" "$work/standins" "$work/classes" "$work/resources"
echo "$out/demo.apk: $(stat -c %s "$out/demo.apk") bytes"
