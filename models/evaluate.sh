#!/usr/bin/env bash
# The table of a model card: models/evaluate.sh CLIPS [--model FILE] [--bank CLIPS] [more options of `visavis eval`]
#
# CLIPS is a folder of clips, best the test split of a corpus (training/README.md), and the bank its training split; samples/eval has two clips for
# a first look (with --quick). Prints the tables and writes them to out/eval/report.md and out/eval/report.json.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[ $# -gt 0 ] || { sed -n '2,5s/^# \{0,1\}//p' "$0" >&2; exit 2; }
clips=$1
shift
mkdir -p out/eval
cargo run --release --quiet -- eval --clips "$clips" --json out/eval/report.json --md out/eval/report.md "$@"
