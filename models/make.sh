#!/usr/bin/env bash
# usage: models/make.sh BUNDLE [REPORT FOLDER]
#
# From a bundle as training exports it (f32; one of f16 will do): bundles to be shipped, their checksums, and the accuracy
# report of f16, int8 and int4 against BUNDLE (into docs/report unless told otherwise). Same bundle, same bytes.
#
#   NAME=room          of models/visavis-NAME-i8.safetensors and, of f16, models/visavis-NAME.safetensors (base)
#   SHIP='i8'          schemes that go into models/ ('f16 i8')
#   CLIPS=DIR          judges all four on these clips with `visavis eval`, for the change of FGD: WINDOWS (240) windows, samplers midpoint4 and single,
#                      and BUNDLE with another seed, which shows what chance alone changes
#   ARM64=no           leaves out the numerics of an arm64 CPU (models/arm64.sh), which are made under emulation where the arm64 kit is there
#   MINUTES=N          length of the report's free runs (10)
#   VISAVIS=PROGRAM    runs that instead of building one
#   KEEP=DIR           keeps bundles, evaluations and numerics there, the int4 bundle too
set -euo pipefail
if [ $# -lt 1 ] || [ ! -f "$1" ]; then echo 'usage: models/make.sh BUNDLE [REPORT FOLDER]' >&2; exit 2; fi
bundle=$(realpath "$1")
clips=${CLIPS:+$(realpath "$CLIPS")}
report=$(realpath -m "${2:-$(dirname "${BASH_SOURCE[0]}")/../docs/report}")
if [ -n "${KEEP:-}" ]; then mkdir -p "$KEEP"; scratch=$(realpath "$KEEP"); else scratch=$(mktemp -d); trap 'rm -rf "$scratch"' EXIT; fi
cd "$(dirname "${BASH_SOURCE[0]}")/.."
visavis() { if [ -n "${VISAVIS:-}" ]; then "$VISAVIS" "$@"; else cargo run --release --quiet -- "$@"; fi; }
say() { echo "$(date +%T) $*" >&2; }

reference=$scratch/reference.safetensors  # BUNDLE may be one of the files that are written here
cp "$bundle" "$reference"
name=visavis-${NAME:-base}
f16=$scratch/$name.safetensors i8=$scratch/$name-i8.safetensors i4=$scratch/$name-i4.safetensors
say 'quantising'
if visavis inspect "$reference" | grep 'flow transformer' | grep -q f32; then
  visavis quantize "$reference" "$f16" --scheme f16
else
  cp "$reference" "$f16"
fi
visavis quantize "$reference" "$i8" --scheme i8
visavis quantize "$reference" "$i4" --scheme i4

more=()
if [ "${ARM64:-}" != no ]; then
  say 'numerics of arm64, under emulation'
  code=0
  models/arm64.sh "$scratch/arm64.json" "$reference" "$f16" "$i8" "$i4" || code=$?
  case $code in
    0) more+=(--other-machine "$scratch/arm64.json") ;;
    3) say 'the report goes without them' ;;
    *) exit $code ;;
  esac
fi
if [ -n "$clips" ]; then
  evaluate() { # evaluate BUNDLE NAME [SEED]
    say "judging $2"
    visavis eval --model "$1" --clips "$clips" --windows "${WINDOWS:-240}" --sampler midpoint4 single --motion-only --seed "${3:-0}" \
      --json "$scratch/eval-$2.json" >/dev/null
  }
  evaluate "$reference" reference
  evaluate "$f16" f16
  evaluate "$i8" i8
  evaluate "$i4" i4
  evaluate "$reference" reference-seed-1 1
  more+=(--eval "$scratch"/eval-{reference,f16,i8,i4}.json --eval-other-seed "$scratch/eval-reference-seed-1.json")
fi
say 'accuracy report'
visavis report --reference "$reference" --candidate "$f16" "$i8" "$i4" --minutes "${MINUTES:-10}" --out "$report" "${more[@]}"
for scheme in ${SHIP:-f16 i8}; do cp "${!scheme}" models/; done
(cd models && sha256sum visavis-*.safetensors >SHA256SUMS)
ls -l models/*.safetensors
say 'done'
