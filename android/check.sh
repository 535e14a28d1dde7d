#!/usr/bin/env bash
# Checks of the Android library: Java sources, native library, both together on this machine's JVM and on an arm64 JVM under
# emulation, the AAR. Usage: android/check.sh
#
# Needs a JDK (17 is installed from Debian if there is none, as root). What needs the arm64 kit (../shared/android) is skipped,
# in words, where that folder is absent.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
kit=$(cd .. && pwd)/shared/android
bundle=tests/goldens/tiny.safetensors
export RUST_BACKTRACE=0 # tests panic on purpose

if ! command -v javac >/dev/null; then
  echo 'android: installing a JDK'
  export DEBIAN_FRONTEND=noninteractive
  apt-get -qq update
  apt-get -qq install -y --no-install-recommends openjdk-17-jdk-headless >/dev/null
fi
target=$(cargo metadata --no-deps --format-version 1 | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
out=$target/android
rm -rf "$out"
mkdir -p "$out"

echo '-- Java sources: library, demo, tests (javac --release 11 -Xlint:all -Werror)'
compile() { # compile NAME CLASSPATH FOLDER
  javac --release 11 -Xlint:all -Werror ${2:+-cp "$2"} -d "$out/$1" $(find "$3" -name '*.java')
}
compile stubs '' android/check/stubs
compile classes "$out/stubs" android/visavis/src/main/java
compile demo "$out/stubs:$out/classes" android/demo/src/main/java
compile tests "$out/stubs:$out/classes:$out/demo" android/check/java
classpath=$out/stubs:$out/classes:$out/demo:$out/tests

echo '-- Rust tests: handle table, microphone'
cargo test --quiet --release -p visavis-android -p visavis-microphone

run_tests() { # run_tests LOG COMMAND...: the tests pass and the JVM's JNI checker has nothing to say
  local log=$1
  shift
  "$@" >"$log" 2>&1 || { tail -40 "$log"; return 1; }
  if grep -nE 'WARNING in native method|FATAL ERROR in native method|WARNING: JNI' "$log"; then
    echo "the JNI checker complains: $log" >&2
    return 1
  fi
  grep -E '^digest |tests passed|^resident' "$log"
}

echo '-- tests on the JVM of this machine, with -Xcheck:jni and 10,000 sessions'
cargo build --quiet --release -p visavis-android
run_tests "$out/host.log" java -Xcheck:jni -ea -Djava.library.path="$target/release" -cp "$classpath" org.visavis.Check "$bundle" 10000 6

if [ ! -x "$kit/build.sh" ]; then
  echo "skipped: there is no $kit, the arm64 kit; the Android library was not built and nothing was tested on arm64"
  exit 0
fi

echo '-- the microphone through oboe: type check (its C++ needs the NDK)'
if ! DOCS_RS=1 "$kit/build.sh" --check android/native --features oboe >"$out/oboe.log" 2>&1; then
  # A check makes no library, which cargo-ndk then misses: that alone is no failure, if the check itself came to its end.
  if ! grep -q 'Finished' "$out/oboe.log" || ! tail -3 "$out/oboe.log" | grep -q 'No cdylib file found to copy'; then
    tail -40 "$out/oboe.log"
    exit 1
  fi
fi
if grep -v 'build-std\|unstable\|No cdylib file found to copy' "$out/oboe.log" | grep -E -A6 '^(warning|error)' >&2; then
  exit 1
fi

echo '-- the Android library: imports against API 29, ELF checks'
so=$("$kit/build.sh" android/native --profile dist)
size=$(stat -c %s "$so")
echo "$size bytes"
[ "$size" -lt 2000000 ] || { echo 'the library without tract is above 2 MB: see the sizes in android/README.md' >&2; exit 1; }

echo '-- the same tests with the Android library on an arm64 JVM; the same motion'
JVM_ARGS='-Xcheck:jni -ea' run_tests "$out/arm64.log" "$kit/run-on-arm64-jvm.sh" "$so" "$classpath" org.visavis.Check "$bundle" 20 6
if ! diff <(grep '^digest ' "$out/host.log") <(grep '^digest ' "$out/arm64.log"); then
  echo 'the motion on arm64 differs from the motion on this machine' >&2
  exit 1
fi

echo '-- AAR: twice the same bytes; parts, manifest, keep rules, natives declared and exported'
for n in 1 2; do
  "$kit/mkaar.py" --package org.visavis --classes "$out/classes" --jni "$so" --proguard android/visavis/consumer-rules.pro \
    --out "$out/visavis-$n.aar"
done
cmp "$out/visavis-1.aar" "$out/visavis-2.aar"
mv "$out/visavis-1.aar" "$out/visavis.aar"
rm "$out/visavis-2.aar"
"$kit/checkaar.py" "$out/visavis.aar"
echo "$out/visavis.aar: $(stat -c %s "$out/visavis.aar") bytes"
