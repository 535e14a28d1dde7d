#!/usr/bin/env bash
# The kernels' tests in WebAssembly, by Node: every variant of every operation has the bits of the scalar one compiled to WebAssembly,
# in the simd128 module and in the relaxed one, and these are the bits of the scalar one compiled for this machine.
# Usage: web/kernels_check.sh
set -euo pipefail
[ $# -eq 0 ] || { echo 'usage: web/kernels_check.sh' >&2; exit 2; }
cd "$(dirname "${BASH_SOURCE[0]}")/.."
modules=()
for features in +simd128 +simd128,+relaxed-simd; do
  modules+=("$(web/module.sh "$features" visavis-kernel-tests --features run --profile dist)")
done
native=$(cargo test -q -p visavis --lib kernels::testing::digests -- --ignored --nocapture)
flags=()
node --experimental-wasm-relaxed-simd -e 0 2>/dev/null && flags=(--experimental-wasm-relaxed-simd)
node "${flags[@]}" web/kernels_check.mjs "$native" "${modules[@]}"
