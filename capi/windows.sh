#!/usr/bin/env bash
# The C library and the command for Windows, on Debian: capi/windows.sh [FOLDER] (default out/windows)
#
#   visavis.dll  visavis.h            the library and its header
#   libvisavis.dll.a  visavis.def     import library of mingw; for MSVC: lib /machine:x64 /def:visavis.def /out:visavis.lib
#   visavis.exe                       the command
#
# Needs Rust; what else is missing is installed as root: mingw's linker from Debian, the target by rustup (.ci/target.sh).
# PROFILE=release builds faster than the default, dist, and gives a larger library with the same bits of motion.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=../.ci/target.sh
. .ci/target.sh
out=${1:-out/windows}
profile=${PROFILE:-dist}
triple=x86_64-pc-windows-gnu
if ! command -v x86_64-w64-mingw32-gcc >/dev/null; then
  echo 'installing gcc-mingw-w64-x86-64'
  export DEBIAN_FRONTEND=noninteractive
  apt-get -qq update
  apt-get -qq install -y --no-install-recommends gcc-mingw-w64-x86-64 >/dev/null
fi
target_std "$triple"
cargo build --quiet --profile "$profile" "${std[@]}" -p visavis-capi -p visavis-tools
target=$(cargo metadata --no-deps --format-version 1 | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
built=$target/$triple/$profile

mkdir -p "$out"
cp "$built/visavis_c.dll" "$out/visavis.dll"
cp "$built/visavis.exe" capi/include/visavis.h "$out"
# The import library names the file that programs look for, hence is made for the new name.
{
  echo 'LIBRARY visavis.dll'
  echo EXPORTS
  x86_64-w64-mingw32-objdump -p "$out/visavis.dll" | sed -nE 's/^.*\] (\+base\[ *[0-9]+\] +[0-9a-f]+ )?(visavis_[a-z_0-9]+)$/  \2/p' | sort -u
} >"$out/visavis.def"
x86_64-w64-mingw32-dlltool -d "$out/visavis.def" -l "$out/libvisavis.dll.a"
# What Windows itself does not have, a headset app's maker would have to ship.
if x86_64-w64-mingw32-objdump -p "$out/visavis.dll" "$out/visavis.exe" |
  sed -n 's/.*DLL Name: //p' | grep -vixE 'api-ms-win-.*|bcryptprimitives.dll|kernel32.dll|msvcrt.dll|ucrtbase.dll|ntdll.dll|userenv.dll|ws2_32.dll|advapi32.dll|bcrypt.dll'; then
  echo 'the library or the command needs the files above, which Windows does not have' >&2
  exit 1
fi
echo "$out: $(cd "$out" && stat -c '%n %s' visavis.dll visavis.exe | tr '\n' ' ')bytes"
