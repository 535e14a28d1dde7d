#!/usr/bin/env bash
# Builds the modules and the npm package and tries them in Node and headless Chromium: web/check.sh
#
# Installs what is missing (as root: Debian's packages; npm's in the user's cache folder). KEEP=1 takes out/web/npm as it is.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=web/node.sh
. web/node.sh
[ -n "${KEEP:-}" ] || web/build.sh
# The same scene natively, against the digests that the next two compare with.
cargo test -p visavis-web
node "${node_flags[@]}" --test web/tests/*.test.js
web/tests/pack/run
# The live page, as a person would try it.
web/page_check.sh
