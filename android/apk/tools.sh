#!/usr/bin/env bash
# Tools for an APK without Gradle and without Google's SDK, on Debian bookworm: android/apk/tools.sh
# Prints the folder that holds the dexer and API 29's list; everything else is in the PATH afterwards. Returns at once when nothing is missing.
# Installing needs root once: packages of the distribution, two files of its archive (checksums below), nothing else.
set -euo pipefail
tools=${VISAVIS_ANDROID_TOOLS:-${XDG_CACHE_HOME:-$HOME/.cache}/visavis/android-tools}
mkdir -p "$tools"
tools=$(cd "$tools" && pwd)
# aapt brings aapt and aapt2, android-framework-res the resources of API 29, proguard-cli tries the keep rules; the rest checks, and draws text.
declare -A packages=(
  [javac]=openjdk-17-jdk-headless [aapt2]=aapt [apksigner]=apksigner [zipalign]=zipalign [proguard]=proguard-cli [dexdump]=dexdump
  [enjarify]=enjarify [smali]=libsmali-java [python3]=python3 [node]=nodejs [xz]=xz-utils
)
missing=()
for command in "${!packages[@]}"; do command -v "$command" >/dev/null || missing+=("${packages[$command]}"); done
[ -f /usr/share/android-framework-res/framework-res.apk ] || missing+=(android-framework-res)
[ -f /usr/share/fonts/truetype/dejavu/DejaVuSans.ttf ] || missing+=(fonts-dejavu-core fontconfig)
if [ ${#missing[@]} -gt 0 ]; then
  echo "installing ${missing[*]}" >&2
  export DEBIAN_FRONTEND=noninteractive
  apt-get -qq update >&2
  apt-get -qq install -y --no-install-recommends "${missing[@]}" >"$tools/apt.log" 2>&1 || { tail -20 "$tools/apt.log" >&2; exit 1; }
fi
if [ ! -f "$tools/dx.jar" ] || [ ! -f "$tools/api-29.txt" ]; then
  echo 'fetching the dexer and the list of API 29 (45 MB)' >&2
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
  mkdir -p "$work"/{lists,cache/archives}/partial
  mirror=$(cat /etc/apt/sources.list /etc/apt/sources.list.d/*.list /etc/apt/sources.list.d/*.sources 2>/dev/null |
    grep -v '^ *#' | grep -oE 'https?://[^ ]+/debian/?' | grep -v security | head -n 1 || true)
  key='[signed-by=/usr/share/keyrings/debian-archive-keyring.gpg]'
  # The release before bookworm has the last dexer that Debian has built.
  printf '%s\n' "deb $key ${mirror:?no Debian mirror in the sources} bullseye main" "deb-src $key $mirror bookworm main" >"$work/sources"
  apt=(apt-get -qq -o Dir::Etc::sourcelist="$work/sources" -o Dir::Etc::sourceparts=/nonexistent -o Dir::State::lists="$work/lists"
    -o Dir::Cache="$work/cache" -o APT::Sandbox::User=root)
  "${apt[@]}" update >&2
  (cd "$work" && "${apt[@]}" download dalvik-exchange >&2 && "${apt[@]}" source --download-only android-platform-frameworks-base >&2)
  (cd "$work" && sha256sum --quiet -c - >&2) <<'SUMS'
8fc128db7c27253d963eb9b33de79b197162a4749d2ba69019b2fd0664cbd7fe  dalvik-exchange_10.0.0+r36-1_all.deb
67251bc9a4152b0d4783653d9d45ec815349771f501f28a8f96479848cfee26b  android-platform-frameworks-base_10.0.0+r36.orig.tar.xz
SUMS
  dpkg -x "$work"/dalvik-exchange_*.deb "$work/dx"
  tar -C "$work" -xf "$work"/android-platform-frameworks-base_*.orig.tar.xz api/current.txt
  cp "$work/dx/usr/share/java/com.android.dx-10.0.0.jar" "$tools/dx.jar"
  cp "$work/api/current.txt" "$tools/api-29.txt"
fi
echo "$tools"
