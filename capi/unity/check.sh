#!/usr/bin/env bash
# Checks of the C# interface and the Unity package, a minute: capi/unity/check.sh [SESSIONS] (default 10000)
#
# The part without Unity is compiled and run on Debian's Mono against the x86-64 library: layouts, digests, errors, threads, leaks. The part for Unity is
# type-checked against stand-ins of Unity's classes (Tests~/stubs), and the package's files are held together. Skipped, in words, where Mono cannot be had.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
sessions=${1:-10000}
package=capi/unity
bundle=tests/goldens/tiny.safetensors

echo '-- the package: every file has a GUID, and what refers to them finds them'
"$package/Tests~/package.py" "$package"

if ! command -v mcs >/dev/null || ! command -v mono >/dev/null; then
  echo '-- installing Mono'
  export DEBIAN_FRONTEND=noninteractive
  if ! { apt-get -qq update && apt-get -qq install -y --no-install-recommends mono-mcs mono-runtime libmono-system-core4.0-cil >/dev/null; }; then
    echo 'skipped: Debian gives no Mono here; no C# was compiled or run'
    exit 0
  fi
fi
target=$(cargo metadata --no-deps --format-version 1 | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
out=$target/unity
rm -rf "$out"
mkdir -p "$out"
compile() { mcs -langversion:7.2 -warnaserror -warn:4 -nologo "$@"; }

echo '-- C#: the library part, the Unity part and the sample against stand-ins'
compile -target:library -out:"$out/Visavis.dll" "$package"/Runtime/*.cs
compile -target:library -out:"$out/UnityEngine.dll" "$package"/Tests~/stubs/*.cs
# Fields that Unity's inspector fills are not assigned in the code.
compile -nowarn:649 -target:library -out:"$out/Visavis.Unity.dll" -r:"$out/Visavis.dll" -r:"$out/UnityEngine.dll" "$package"/Unity/*.cs
compile -target:library -out:"$out/Sample.dll" -r:"$out/Visavis.dll" -r:"$out/Visavis.Unity.dll" -r:"$out/UnityEngine.dll" "$package"/Samples~/Conversation/*.cs

echo '-- C#: run against the x86-64 library; layouts, digests, errors, threads'
cargo build --quiet --release -p visavis-capi
cp "$target/release/libvisavis_c.so" "$out/libvisavis.so"
"$package/Tests~/layouts.py" capi/include/visavis.h >"$out/layouts.c"
cc -I capi/include "$out/layouts.c" -o "$out/layouts"
"$out/layouts" >"$out/layouts.txt"
cc -std=gnu11 -I capi/include capi/examples/smoke.c -o "$out/smoke" "$target/release/libvisavis_c.a" -lpthread -ldl -lm
digest=$("$out/smoke" "$bundle" | sed -n 's/.*digest //p')
compile -out:"$out/Check.exe" -r:"$out/Visavis.dll" "$package"/Tests~/*.cs
MONO_PATH=$out LD_LIBRARY_PATH=$out mono --debug "$out/Check.exe" "$bundle" "$out/layouts.txt" "$digest" "$sessions"

echo '-- a wrong layout and a wrong digest are found'
for fault in layout digest; do
  sed 's/^Frame.HipsX .*/Frame.HipsX 44/' "$out/layouts.txt" >"$out/wrong.txt"
  arguments=("$bundle" "$out/layouts.txt" "$digest" 10)
  [ $fault = layout ] && arguments[1]=$out/wrong.txt || arguments[2]=0123456789abcdef
  if MONO_PATH=$out LD_LIBRARY_PATH=$out mono "$out/Check.exe" "${arguments[@]}" >"$out/$fault.log" 2>&1 || ! grep -q "FAILED: .*$fault" "$out/$fault.log"; then
    cat "$out/$fault.log"
    exit 1
  fi
done
