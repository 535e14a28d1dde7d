#!/usr/bin/env bash
# The Windows library and command under Debian's Wine, minutes: capi/windows/check.sh [full]
#
# full: only what takes longer, tests of the pool, of bundles and sessions inside, of bad input, and of threads that push through C.
# Promises of sessions, inputs, files and paths; the C example; the demo's motion, in bytes those of this system. Skipped, in words, where
# Wine or mingw cannot be had. Wine is not Windows: docs/platforms.md says what it does not show.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
export DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8
# shellcheck source=../../.ci/target.sh
. .ci/target.sh
if ! command -v x86_64-w64-mingw32-gcc >/dev/null || [ ! -x /usr/lib/wine/wine64 ]; then
  echo '-- installing mingw and Wine'
  if ! { apt-get -qq update && apt-get -qq install -y --no-install-recommends gcc-mingw-w64-x86-64 wine64 >/dev/null; }; then
    echo 'skipped: Debian gives no mingw or Wine here; nothing was built for Windows'
    exit 0
  fi
fi
wine=$PWD/capi/windows/wine.sh
out=out/windows
bundle=tests/goldens/tiny.safetensors
target_std x86_64-pc-windows-gnu
export CARGO_TARGET_X86_64_PC_WINDOWS_GNU_RUNNER=$wine

tests() { cargo test --quiet --release "${std[@]}" "$@"; }
if [ "${1:-}" = full ]; then
  tests -p visavis --lib -- par:: bundle:: session::
  tests -p visavis --test bad_input
  tests -p visavis-capi --test threads
  exit
fi

echo '-- the library, its import library and the command'
PROFILE=release capi/windows.sh "$out"
diff <(grep -oE '\bvisavis_[a-z_0-9]+\(' capi/include/visavis.h | tr -d '(' | sort -u) <(sed -n 's/^  //p' "$out/visavis.def")

echo '-- the C example, against the import library'
x86_64-w64-mingw32-gcc -std=gnu11 -Wall -Wextra -Werror -I "$out" capi/examples/smoke.c -o "$out/smoke.exe" -L "$out" -lvisavis -l:libwinpthread.a
"$wine" "$out/smoke.exe" "$bundle" | tee "$out/smoke.txt"
echo '-- and here: the same motion'
cargo build --quiet --release -p visavis-capi -p visavis-tools
target=$(cargo metadata --no-deps --format-version 1 | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
cc -std=gnu11 -Wall -Wextra -Werror -I "$out" capi/examples/smoke.c -o "$out/smoke" "$target/release/libvisavis_c.a" -lpthread -ldl -lm
diff <("$out/smoke" "$bundle") <(tr -d '\r' <"$out/smoke.txt")

echo '-- the demo: the same files'
rm -rf "$out/here" "$out/Ausgabe für Zoë"
"$target/release/visavis" demo --out "$out/here" >/dev/null 2>&1
"$wine" "$out/visavis.exe" demo --out "$out/Ausgabe für Zoë" >"$out/demo.txt" 2>&1 || { cat "$out/demo.txt"; exit 1; }
for name in motion.bvh motion.glb motion.vrma; do
  cmp "$out/here/$name" "$out/Ausgabe für Zoë/$name"
done
(cd "$out/here" && sha256sum motion.*)

echo '-- tests: sessions on one and two threads, inputs of other threads, files, paths'
# Tests that start the command start it without wine.sh.
cp "$out/bcryptprimitives.dll" "$target/x86_64-pc-windows-gnu/release/"
tests -p visavis --test session --test inputs
tests -p visavis-tools --test windows
tests -p visavis-capi --test paths
