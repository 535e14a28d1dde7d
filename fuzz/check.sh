#!/usr/bin/env bash
# Fuzzes for a while, without cargo-fuzz and without a nightly toolchain: fuzz/check.sh SECONDS [TARGET...]
#
# Builds the targets of this folder with the coverage counters that libFuzzer needs (flags that stable compilers accept
# with RUSTC_BOOTSTRAP) and runs each for SECONDS, from the seeds of seeds.py. SANITIZER=address adds AddressSanitizer;
# RUNS=N runs N executions a target, always the same ones, instead of SECONDS. Exit code 0: no crash, no time-out, no memory beyond 3 GiB.
# What a target finds is left in fuzz/artifacts/TARGET/; replay it with fuzz/check.sh 0 TARGET FILE.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
[ $# -ge 1 ] || { sed -n '2,8s/^# \{0,1\}//p' "$0"; exit 2; }
seconds=$1
shift
targets=(bundle_bytes bundle_lies wav csv session capi)
[ $# -eq 0 ] || targets=("$1")
replay=${2:-}

host=$(rustc -vV | sed -n 's/^host: //p')
flags='--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4
  -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table
  -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1'
out=target
if [ "${SANITIZER:-none}" != none ]; then
  flags+=" -Zsanitizer=$SANITIZER"
  out=target/$SANITIZER
fi
# With --target the flags are for the program alone, not for build scripts.
RUSTC_BOOTSTRAP=1 RUSTFLAGS=$(echo $flags) \
  cargo build --release --quiet --target "$host" --target-dir "$out" $(printf -- '--bin %s ' "${targets[@]}")
command -v python3 >/dev/null && python3 seeds.py >/dev/null

limits=(-rss_limit_mb=3072 -malloc_limit_mb=1536 -timeout=30 -print_final_stats=1 -verbosity=0 -max_len=400000)
for target in "${targets[@]}"; do
  program=$out/$host/release/$target
  mkdir -p "corpus/$target" "artifacts/$target" "$out/work/$target"
  if [ -n "$replay" ]; then
    "$program" "${limits[@]}" "$replay"
    continue
  fi
  for_long=(-max_total_time="$seconds")
  [ -z "${RUNS:-}" ] || for_long=(-runs="$RUNS" -seed=1)
  [ "$target" = bundle_bytes ] || for_long+=(-max_len=4096)
  echo "== $target"
  # New inputs go to the folder of work, seeds stay as they are.
  status=0
  "$program" "${limits[@]}" "${for_long[@]}" -artifact_prefix="artifacts/$target/" "$out/work/$target" "corpus/$target" \
    >"$out/work/$target.log" 2>&1 || status=$?
  grep -E '^(stat::number_of_executed_units|stat::average_exec_per_sec|stat::peak_rss_mb|==[0-9]+==|SUMMARY|.*panicked)' "$out/work/$target.log" || true
  [ "$status" = 0 ] || { echo "fuzz/$target: exit code $status; see fuzz/artifacts/$target" >&2; exit 1; }
done
