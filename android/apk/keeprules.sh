#!/usr/bin/env bash
# What a shrinker leaves with the library's consumer rules: android/apk/keeprules.sh MANIFEST.pro STANDINS CLASSES...
# ProGuard stands for R8, which reads the same rules. Native methods that are used, and what the native library constructs, must keep their names;
# something else must have lost its own, or nothing was tried.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
manifest=$1 standins=$2
shift 2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# java.* as release 8 has it: the compiler's own list, of class files without code.
python3 - "$(dirname "$(dirname "$(realpath "$(command -v javac)")")")/lib/ct.sym" "$work/java.jar" <<'PY'
import re, sys, zipfile
with zipfile.ZipFile(sys.argv[1]) as symbols, zipfile.ZipFile(sys.argv[2], "w") as jar:
    seen = set()
    for name in symbols.namelist():
        found = re.match(r"[^/]*8[^/]*/(?:[a-z]+\.[a-z.]+/)?(java/(?:lang|util|io|nio|net|security|text|math)/.*)\.sig$", name)
        if found and found[1] not in seen:
            seen.add(found[1])
            data = symbols.read(name)
            jar.writestr(found[1] + ".class", data[:6] + b"\0\x34" + data[8:])  # of the compiler's own version: of Java 8
PY
inputs=()
for folder in "$@"; do inputs+=(-injars "$folder"); done
proguard @"$manifest" @android/visavis/consumer-rules.pro "${inputs[@]}" -outjars "$work/out.jar" -libraryjars "$work/java.jar:$standins" \
  -dontoptimize -dontnote -dontwarn 'androidx.**' >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
PYTHONPATH=android/apk python3 - "$work/out.jar" "$@" <<'PY'
import sys
from classfile import read
kept, before = read(sys.argv[1:2]), read(sys.argv[2:])
members = lambda classes, word: {(c.name, m[1], m[2]) for c in classes.values() for m in c.methods if word in m[0]}
natives, left = members(before, "native"), members(kept, "native")
made = [n for n in before if n == "org/visavis/VisavisException" or n.startswith("org/visavis/BundleException") or n == "org/visavis/MicrophoneException"]
lost = left - natives | {(n, "<init>", "(Ljava/lang/String;)V") for n in made} - members(kept, "public")
renamed = len(set(kept) - set(before))
print(f"{len(before)} classes, {len(kept)} left, {renamed} renamed; names kept: {len(left)} native methods that are used, {len(made)} exceptions")
if lost or not left or len(made) < 5 or not renamed:
    sys.exit(f"lost: {sorted(lost)}")
PY
