# What the checks and the benchmark need of Node: packages in the user's cache folder, a browser. Sourced, from the root.
# shellcheck shell=bash
# shellcheck source=.ci/steps.sh
declare -F packages >/dev/null || . .ci/steps.sh
packages chromium=chromium node=nodejs npm=npm >&2
export VISAVIS_NODE_DIR=${VISAVIS_NODE_DIR:-$cache/web}
CHROMIUM=${CHROMIUM:-$(command -v chromium || command -v google-chrome)}
export CHROMIUM
if ! [ -d "$VISAVIS_NODE_DIR/node_modules/puppeteer-core" ] || ! [ -d "$VISAVIS_NODE_DIR/node_modules/esbuild" ]; then
  mkdir -p "$VISAVIS_NODE_DIR"
  # esbuild's program comes as an optional package: no scripts are needed.
  npm install --prefix "$VISAVIS_NODE_DIR" --ignore-scripts --no-audit --no-fund --silent puppeteer-core esbuild
fi
# Relaxed SIMD is behind a flag before Node 22.
node_flags=()
[ "$(node -p 'process.versions.node.split(".")[0]')" -ge 22 ] || node_flags=(--experimental-wasm-relaxed-simd)
