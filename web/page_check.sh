#!/usr/bin/env bash
# Tries the live page in headless Chromium as a person would: web/page_check.sh [CHECK ...]
#
# After web/build.sh. Screenshots go to out/live. CHROMIUM names the browser. Checks: person phone xr models sounds broken site memory (default: all).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[ -s out/web/visavis.html ] || { echo 'there is no out/web/visavis.html: run web/build.sh first' >&2; exit 1; }
node web/live/check.mjs out/web out/live "$@"
