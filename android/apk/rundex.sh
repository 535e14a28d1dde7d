#!/usr/bin/env bash
# What this machine can say about a dex: android/apk/rundex.sh CLASSES.dex HOSTLIBDIR [CHECKS]
# Its structure and checksum (dexdump), smali and back, and the Java tests on class files that enjarify makes of it, with the JNI library of this
# machine (cargo build --release -p visavis-android; HOSTLIBDIR: target/release). CHECKS: main classes, by default both suites.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
dex=$(realpath "$1") lib=$2
shift 2
[ $# -gt 0 ] || set -- org.visavis.Check org.visavis.demo.DemoCheck
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
dexdump -c "$dex" >/dev/null
baksmali d "$dex" -o "$work/a"
smali a "$work/a" -a 29 -o "$work/b.dex"
baksmali d "$work/b.dex" -o "$work/b"
diff -r "$work/a" "$work/b"
cp "$dex" "$work/classes.dex"
PYTHONPATH=/usr/lib/python3/dist-packages /usr/bin/python3 -O -m enjarify.main -f -o "$work/dex.jar" "$work/classes.dex" >/dev/null
# Tests are compiled against the sources (a jar of a dex has lost what nests in what) and run on the dex.
compile() { # compile NAME CLASSPATH FOLDER...
  local name=$1 path=$2
  shift 2
  # shellcheck disable=SC2046
  javac --release 11 -proc:none ${path:+-cp "$path"} -d "$work/$name" $(find "$@" -name '*.java')
}
compile standins '' android/check/stubs
compile sources "$work/standins" android/visavis/src/main/java android/demo/src/main/java
compile tests "$work/standins:$work/sources" android/check/java
rm -rf "$work/standins/org/visavis" # the app's own R is in the dex
node android/apk/stage.mjs tests/goldens/tiny.safetensors "$work/stage.bin"
for main in "$@"; do
  java -Xcheck:jni -ea -Djava.awt.headless=true -Djava.library.path="$lib" -Dvisavis.stage="$work/stage.bin" \
    -Dvisavis.strings=android/demo/src/main/res/values/strings.xml \
    -cp "$work/dex.jar:$work/standins:$work/tests" "$main" tests/goldens/tiny.safetensors 200 6 >"$work/log" 2>&1 || { tail -30 "$work/log"; exit 1; }
  grep -E '^digest|passed|FAILED' "$work/log"
done
