#!/usr/bin/env bash
# Builds a package of this workspace for wasm32-unknown-unknown and prints the module's path on stdout.
# Usage: web/module.sh FEATURES PACKAGE [cargo arguments]     web/module.sh +simd128,+relaxed-simd visavis-web --profile dist
#
# Uses rustup's target where there is one; elsewhere the standard library is built from Debian's sources by Debian's compiler
# (installed by root when missing; about a minute more the first time) and linked with the toolchain's rust-lld.
# Flags in RUSTFLAGS are kept; each set of flags has a target folder of its own.
set -euo pipefail
features=${1:?usage: web/module.sh FEATURES PACKAGE [cargo arguments]}
package=${2:?usage: web/module.sh FEATURES PACKAGE [cargo arguments]}
shift 2
cd "$(dirname "${BASH_SOURCE[0]}")/.."
target=wasm32-unknown-unknown
RUSTFLAGS="${RUSTFLAGS:-} -Ctarget-feature=$features"
export RUSTFLAGS CARGO_TARGET_DIR
CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-target}/wasm-$(tr -dc 'a-z0-9' <<<"${RUSTFLAGS//-C/}")"
std=()
if ! { command -v rustup >/dev/null && rustup target list --installed 2>/dev/null | grep -qx "$target"; }; then
  missing=()
  [ -x /usr/bin/rustc ] || missing+=(rustc-web)
  [ -d "$(/usr/bin/rustc --print sysroot 2>/dev/null || echo /usr)/lib/rustlib/src/rust/library" ] || missing+=(rust-web-src)
  if [ ${#missing[@]} -gt 0 ]; then
    { apt-get -qq update && DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends "${missing[@]}"; } >&2 ||
      { echo "install Rust's target: rustup target add $target" >&2; exit 1; }
  fi
  sysroot=$(rustc --print sysroot)
  linker=$(find "$sysroot/lib/rustlib" -path '*/bin/rust-lld' -not -path '*gcc-ld*' 2>/dev/null | head -n 1)
  [ -n "$linker" ] || linker=$(command -v rust-lld wasm-ld lld 2>/dev/null | head -n 1)
  export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$linker RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1
  std=(-Zbuild-std=std,panic_abort)
fi
cargo build "${std[@]}" --target "$target" -p "$package" --lib "$@" >&2
find "$PWD/${CARGO_TARGET_DIR#"$PWD/"}/$target" -maxdepth 2 -name "${package//-/_}.wasm" -printf '%T@ %p\n' | sort -n | tail -n 1 | cut -d' ' -f2-
