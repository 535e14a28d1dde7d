#!/usr/bin/env bash
# The kernels' tests in WebAssembly, by Node: every variant of every operation has the bits of the scalar one compiled to WebAssembly,
# and these are the bits of the scalar one compiled for this machine. Usage: web/kernels_check.sh [simd128] [relaxed]
#
# Names choose modules (default: both); the relaxed one has the variants of both levels.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[ $# -gt 0 ] || set -- simd128 relaxed
modules=()
for module in "$@"; do
  case $module in
  simd128) features=+simd128 ;;
  relaxed) features=+simd128,+relaxed-simd ;;
  *) echo 'usage: web/kernels_check.sh [simd128] [relaxed]' >&2; exit 2 ;;
  esac
  modules+=("$(web/module.sh "$features" visavis-kernel-tests --features run --profile dist)")
done
# As `cargo test` builds it, so that nothing is built twice where that ran.
native=$(cargo test -q --lib kernels::testing::digests -- --ignored --nocapture)
flags=()
node --experimental-wasm-relaxed-simd -e 0 2>/dev/null && flags=(--experimental-wasm-relaxed-simd)
node "${flags[@]}" web/kernels_check.mjs "$native" "${modules[@]}"
