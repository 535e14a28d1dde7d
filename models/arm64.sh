#!/usr/bin/env bash
# usage: models/arm64.sh OUT.json REFERENCE CANDIDATE...
#
# The numerics of `visavis report` as an arm64 CPU computes them, for `visavis report --other-machine OUT.json`: builds the program for
# aarch64 Linux and runs it under emulation. BLOCKS (12) blocks a row: a block of eight evaluations takes seconds so. QEMU_CPU picks the core
# (max: i8mm and all else; cortex-a57: NEON alone). Needs the arm64 kit (ARM64_KIT, by default ../shared/android beside this repository; it
# installs what it lacks) and exits with 3 where there is none.
set -euo pipefail
if [ $# -lt 3 ]; then sed -n '2s/^# //p' "$0" >&2; exit 2; fi
out=$(realpath "$1") reference=$(realpath "$2")
shift 2
candidates=(); for file in "$@"; do candidates+=("$(realpath "$file")"); done
cd "$(dirname "${BASH_SOURCE[0]}")/.."
kit=${ARM64_KIT:-../shared/android}
[ -x "$kit/setup.sh" ] || { echo "models/arm64.sh: there is no arm64 kit at $kit" >&2; exit 3; }
# shellcheck source=/dev/null
. "$kit/common.sh"
"$KIT/setup.sh" >&2
target=aarch64-unknown-linux-gnu
CARGO_TARGET_DIR=$(target_dir arm64)
export CARGO_TARGET_DIR RUSTC=/usr/bin/rustc CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
cargo build --release --quiet --target $target -p visavis-tools
# Voices and user of the sample conversation come from here, as in every run without files.
qemu-aarch64-static -cpu "${QEMU_CPU:-max}" -L "$ARM64" "$CARGO_TARGET_DIR/$target/release/visavis" \
  report --reference "$reference" --candidate "${candidates[@]}" --blocks "${BLOCKS:-12}" --numerics-only "$out"
