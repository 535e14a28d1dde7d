#!/usr/bin/env bash
# The Unity package with its libraries: capi/unity/package.sh -> out/unity/org.visavis.unity and a .tgz beside it
#
# Windows (capi/windows.sh), Linux x86-64 and Android arm64; on Debian with Rust. Android is built with Google's NDK where ANDROID_NDK_HOME names one
# (r28 or newer). Else that library is left out, unless STANDINS=yes: then with the stand-in NDK of ../shared/android, for checks, not for devices.
# PROFILE=release builds faster than the default, dist.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
profile=${PROFILE:-dist}
kit=$(cd .. && pwd)/shared/android
out=out/unity/org.visavis.unity
target=$(cargo metadata --no-deps --format-version 1 | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
rm -rf "$out"
mkdir -p "$out"
cp -R capi/unity/{package.json,README.md,Runtime,Unity,Plugins,Samples~} "$out"
cp capi/unity/*.meta "$out"
cp LICENSE-MIT LICENSE-APACHE "$out"
for name in LICENSE-MIT LICENSE-APACHE; do
  printf 'fileFormatVersion: 2\nguid: %s\nDefaultImporter:\n  externalObjects: {}\n' "$(printf 'org.visavis.unity/%s' "$name" | md5sum | cut -c1-32)" >"$out/$name.meta"
done

PROFILE=$profile capi/windows.sh out/windows
cp out/windows/visavis.dll "$out/Plugins/Windows/"
cargo build --quiet --profile "$profile" -p visavis-capi
cp "$target/$profile/libvisavis_c.so" "$out/Plugins/Linux/libvisavis.so"
android=''
if [ -n "${ANDROID_NDK_HOME:-}" ]; then
  rustup target add aarch64-linux-android
  linker=$(echo "$ANDROID_NDK_HOME"/toolchains/llvm/prebuilt/*/bin/aarch64-linux-android29-clang)
  [ -x "$linker" ] || { echo "no compiler for API 29 in $ANDROID_NDK_HOME: it takes NDK r28 or newer" >&2; exit 1; }
  CARGO_TARGET_AARCH64_LINUX_ANDROID_LINKER=$linker CARGO_TARGET_AARCH64_LINUX_ANDROID_RUSTFLAGS='-Clink-arg=-Wl,-z,max-page-size=16384' \
    cargo build --quiet --profile "$profile" -p visavis-capi --target aarch64-linux-android
  android=$target/aarch64-linux-android/$profile/libvisavis_c.so
elif [ "${STANDINS:-}" = yes ]; then
  android=$("$kit/build.sh" capi --profile "$profile")
  echo '*** Android: linked against stand-ins for the NDK; for checks only, not for devices.' >&2
else
  echo '*** Android: left out. Set ANDROID_NDK_HOME to Google'"'"'s NDK r28 or newer.' >&2
  rm -r "$out/Plugins/Android" "$out/Plugins/Android.meta"
fi
[ -z "$android" ] || cp "$android" "$out/Plugins/Android/libvisavis.so"
version=$(sed -nE 's/^ *"version": "(.*)",/\1/p' "$out/package.json")
tar -C out/unity --sort=name --mtime=@0 --owner=0 --group=0 --numeric-owner --transform 's|^org.visavis.unity|package|' -cf - org.visavis.unity |
  gzip -n >"out/unity/org.visavis.unity-$version.tgz"
(cd out/unity && stat -c '%n %s bytes' "org.visavis.unity-$version.tgz" && find org.visavis.unity/Plugins -name '*visavis.*' ! -name '*.meta' -exec stat -c '  %n %s bytes' {} +)
