#!/usr/bin/env bash
# Checks of the C interface: header up to date, layouts, programs and libraries of two versions, and a C program under the address
# sanitizer. Usage: capi/check.sh
#
# Needs a C compiler; as root, gcc is installed from Debian if there is none.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if ! command -v cc >/dev/null; then
  echo 'capi: installing gcc'
  DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends gcc libc6-dev >/dev/null
fi

# What features of its dependencies the library is built with goes by all packages of a command: with these two it is the same here and in
# android/check.sh, and built once.
faces=(--quiet --release -p visavis-capi -p visavis-android)
echo '-- tests: header, layouts, C#'
cargo test --quiet -p visavis-header
cargo test "${faces[@]}"
target=$(cargo metadata --no-deps --format-version 1 | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
out=$target/capi
mkdir -p "$out/next"
echo '-- library, and one of the next version, whose structs have grown'
cargo build "${faces[@]}" --features visavis-capi/grown
cp "$target/release/libvisavis_c.so" "$out/next/"
# In the profile of its test, which has built the generator.
cargo run --quiet --profile test -p visavis-header -- "$out/next/visavis.h"
cargo build "${faces[@]}"

echo '-- header alone: C and, where there is a compiler, C++'
cc -x c -Wall -Wextra -Werror -pedantic -fsyntax-only -include capi/include/visavis.h - </dev/null
if command -v c++ >/dev/null; then
  c++ -x c++ -Wall -Wextra -Werror -pedantic -fsyntax-only -include capi/include/visavis.h - </dev/null
else
  echo 'skipped: there is no C++ compiler'
fi

warnings=(-std=gnu11 -Wall -Wextra -Werror)
libraries=(-lpthread -ldl -lm)
echo '-- smoke program, shared library'
cc "${warnings[@]}" -I capi/include capi/examples/smoke.c -o "$out/smoke" -L "$target/release" -lvisavis_c "${libraries[@]}"
LD_LIBRARY_PATH=$target/release "$out/smoke" tests/goldens/tiny.safetensors
echo '-- programs and libraries of two versions'
versions() { # versions NAME HEADER FLAGS...
  local name=$1 header=$2
  shift 2
  cc "${warnings[@]}" "$@" -I "$header" capi/tests/versions.c -o "$out/$name" -L "$target/release" -lvisavis_c "${libraries[@]}"
}
versions program capi/include
versions next-program "$out/next" -DNEWER
LD_LIBRARY_PATH=$target/release "$out/program" tests/goldens/tiny.safetensors same
LD_LIBRARY_PATH=$out/next "$out/program" tests/goldens/tiny.safetensors newer
LD_LIBRARY_PATH=$target/release "$out/next-program" tests/goldens/tiny.safetensors older
LD_LIBRARY_PATH=$out/next "$out/next-program" tests/goldens/tiny.safetensors same
echo '-- smoke program, static library, address sanitizer with leak check'
if echo 'int main(void) { return 0; }' | cc -fsanitize=address,undefined -x c - -o "$out/probe" 2>/dev/null && "$out/probe"; then
  cc "${warnings[@]}" -g -fsanitize=address,undefined -fno-omit-frame-pointer -I capi/include capi/examples/smoke.c -o "$out/smoke-asan" \
    "$target/release/libvisavis_c.a" "${libraries[@]}"
  ASAN_OPTIONS=detect_leaks=1:abort_on_error=0 "$out/smoke-asan" tests/goldens/tiny.safetensors
else
  echo 'skipped: this compiler has no working address sanitizer'
fi
