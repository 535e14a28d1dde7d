# A target that rustc builds for on any machine: sourced, then `target_std TRIPLE` sets $std, arguments for cargo. Tells where it has the standard library from.
# shellcheck shell=bash
#
# Takes rustup's standard library for the target; where rustup or the target cannot be had, compiles it from the sources of Debian's
# packages rustc-web and rust-web-src (installed as root).
target_std() {
  std=(--target "$1")
  if [ -z "${VISAVIS_BUILD_STD:-}" ] && command -v rustup >/dev/null; then
    rustup target list --installed | grep -qx "$1" && return
    rustup target add "$1" >&2 && return
    echo "rustup has no $1 here: its standard library is compiled from Debian's sources" >&2
  fi
  if [ ! -x /usr/bin/rustc ] || [ ! -d "$(/usr/bin/rustc --print sysroot)/lib/rustlib/src/rust/library" ]; then
    export DEBIAN_FRONTEND=noninteractive
    apt-get -qq update
    apt-get -qq install -y --no-install-recommends rustc-web rust-web-src >/dev/null
  fi
  export RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1
  std+=(-Zbuild-std=std,panic_abort,panic_unwind)
}
