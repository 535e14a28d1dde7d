#!/usr/bin/env bash
# usage: models/make.sh BUNDLE [REPORT FOLDER]
#
# From a bundle as training exports it (f32; one of f16 will do): the f16 and int8 bundles that are shipped, their checksums, and the accuracy
# report of f16, int8 and int4 against BUNDLE (into docs/report unless told otherwise). OTHER_MACHINE=FILE.json adds another
# machine's numerics to the report: `visavis report ... --numerics-only FILE.json` writes them there.
# CLIPS=DIR (clips of the training corpus) judges all four bundles with `visavis eval` too, on WINDOWS windows (16), and adds that.
# VISAVIS=PROGRAM runs that instead of building one. Same bundle, same bytes.
set -euo pipefail
if [ $# -lt 1 ] || [ ! -f "$1" ]; then echo 'usage: models/make.sh BUNDLE [REPORT FOLDER]' >&2; exit 2; fi
bundle=$(realpath "$1")
cd "$(dirname "${BASH_SOURCE[0]}")/.."
report=${2:-docs/report}
scratch=$(mktemp -d); trap 'rm -rf "$scratch"' EXIT
visavis() { if [ -n "${VISAVIS:-}" ]; then "$VISAVIS" "$@"; else cargo run --release --quiet -- "$@"; fi; }

reference=$scratch/reference.safetensors  # BUNDLE may be one of the files that are written here
cp "$bundle" "$reference"
f16=$scratch/visavis-base.safetensors i8=$scratch/visavis-base-i8.safetensors i4=$scratch/visavis-base-i4.safetensors
if visavis inspect "$reference" | grep 'flow transformer' | grep -q f32; then
  visavis quantize "$reference" "$f16" --scheme f16
else
  cp "$reference" "$f16"
fi
visavis quantize "$reference" "$i8" --scheme i8
visavis quantize "$reference" "$i4" --scheme i4
eval=()
if [ -n "${CLIPS:-}" ]; then
  for bundle in "$reference" "$f16" "$i8" "$i4"; do
    json=$scratch/$(basename "$bundle" .safetensors).json
    visavis eval --model "$bundle" --clips "$CLIPS" --windows "${WINDOWS:-16}" --sampler midpoint4 --quick --json "$json" >&2
    eval+=("$json")
  done
fi
visavis report --reference "$reference" --candidate "$f16" "$i8" "$i4" --out "$report" \
  ${OTHER_MACHINE:+--other-machine "$OTHER_MACHINE"} ${eval:+--eval "${eval[@]}"}
cp "$f16" "$i8" models/
(cd models && sha256sum visavis-base.safetensors visavis-base-i8.safetensors >SHA256SUMS)
ls -l models/*.safetensors
