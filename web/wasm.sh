#!/usr/bin/env bash
# Builds a package for wasm32-unknown-unknown: web/wasm.sh FEATURES PACKAGE CARGO-ARGUMENTS... MODULE
#
# FEATURES as for -Ctarget-feature. The module is copied to MODULE. With rustup's target the standard library is at hand;
# without it it is built from Debian's sources by Debian's compiler (rustc-web, rust-web-src), installed as root.
set -euo pipefail
features=${1:?usage: web/wasm.sh FEATURES PACKAGE CARGO-ARGUMENTS... MODULE} package=${2:?usage: see above}
shift 2
module=${*: -1}
set -- "${@:1:$#-1}"
target=wasm32-unknown-unknown

std=()
if ! { command -v rustup >/dev/null && rustup target list --installed 2>/dev/null | grep -qx $target; }; then
  sources=/usr/lib/rustlib/src/rust/library
  if [ ! -x /usr/bin/rustc ] || [ ! -d $sources ]; then
    echo "no target $target: installing Debian's compiler and its sources" >&2
    export DEBIAN_FRONTEND=noninteractive
    apt-get -qq update
    apt-get -qq install -y --no-install-recommends rustc-web rust-web-src >/dev/null
  fi
  lld=$(find "$(rustc --print sysroot)/lib/rustlib" -path '*/bin/rust-lld' -not -path '*gcc-ld*' | head -n 1)
  export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=${lld:-rust-lld} RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1
  std=(-Zbuild-std=std,panic_abort)
fi
# A folder per set of features: they change every crate.
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-target}/wasm-$(tr -dc 'a-z0-9' <<<"$features")"
RUSTFLAGS="${RUSTFLAGS:-} -Ctarget-feature=$features" cargo build "${std[@]}" --target $target -p "$package" "$@"
# One library per package: its module bears the package's name.
cp "$CARGO_TARGET_DIR/$target/dist/${package//-/_}.wasm" "$module"
