#!/usr/bin/env bash
# Library, C interface and command are type-checked for systems that nothing can be linked or run for here: .ci/targets.sh [TARGET...]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=target.sh
. .ci/target.sh
[ $# -gt 0 ] || set -- aarch64-apple-darwin x86_64-pc-windows-msvc x86_64-linux-android
for triple in "$@"; do
  echo "-- $triple"
  target_std "$triple"
  packages=(-p visavis -p visavis-capi -p visavis-tools)
  [[ $triple != *-android ]] || packages+=(-p visavis-android)
  cargo check --quiet "${std[@]}" "${packages[@]}"
done
