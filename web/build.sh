#!/usr/bin/env bash
# Builds the WebAssembly modules and what is made of them: web/build.sh
#
# Leaves out/web/npm (the npm package), out/web/visavis.html (the live page in one file) and out/web/site (the live page for
# any static host). Needs Rust; installs Node and npm from Debian where they are missing, as root. The target comes from rustup
# (`rustup target add wasm32-unknown-unknown`); without it the standard library is built from Debian's sources.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=.ci/steps.sh
. .ci/steps.sh
packages node=nodejs npm=npm >&2

out=out/web/npm
rm -rf "$out"
mkdir -p "$out"
for module in simd128 relaxed; do
  features=+simd128
  [ $module = simd128 ] || features+=,+relaxed-simd
  cp "$(web/module.sh "$features" visavis-web --profile dist)" "$out/visavis-$module.wasm"
done
cp web/npm/*.js web/npm/*.d.ts web/npm/package.json web/npm/README.md LICENSE-* "$out"
ls -l "$out"/*.wasm | awk '{ print $NF ": " $5 " bytes" }'
for module in "$out"/*.wasm; do echo "$module: $(gzip -9 <"$module" | wc -c) bytes compressed"; done

if [ -f web/live/build.mjs ]; then
  node web/live/build.mjs
fi
