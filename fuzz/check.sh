#!/usr/bin/env bash
# Fuzzes, without cargo-fuzz and without a nightly toolchain: fuzz/check.sh SECONDS [TARGET [FILE]]
#
# Builds the targets of this folder with the coverage counters that libFuzzer needs (flags that stable compilers accept
# with RUSTC_BOOTSTRAP) and runs each for SECONDS, from the seeds of seeds.py and what earlier runs found. Settings:
#   RUNS=N             N executions a target instead of SECONDS, always the same ones: from the seeds alone
#   SANITIZER=address  with AddressSanitizer
#   COMPARES=1         comparisons guide the search too: for the readers of text and sound; three times slower
# Exit code 0: no crash, no time-out, no memory beyond 3 GiB; 3: this toolchain cannot build the targets, and why.
# What a target finds is left in fuzz/artifacts/TARGET/; replay it with fuzz/check.sh 0 TARGET FILE.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
[ $# -ge 1 ] || { sed -n '2,10s/^# \{0,1\}//p' "$0"; exit 2; }
seconds=$1
shift
targets=(bundle_bytes bundle_lies wav csv session capi)
[ $# -eq 0 ] || targets=("$1")
replay=${2:-}

host=$(rustc -vV | sed -n 's/^host: //p')
flags='--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=3
  -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table -Ccodegen-units=4'
out=target/counters
if [ "${COMPARES:-0}" != 0 ]; then
  flags+=' -Cllvm-args=-sanitizer-coverage-trace-compares'
  out=target/compares
fi
if [ "${SANITIZER:-none}" != none ]; then
  flags+=" -Zsanitizer=$SANITIZER"
  out+=-$SANITIZER
fi
flags=$(echo $flags)

cannot() { echo "fuzz: this toolchain cannot build the targets: $*" >&2; exit 3; }
command -v c++ >/dev/null || command -v g++ >/dev/null || cannot 'libFuzzer needs a C++ compiler'
probe=$(mktemp -d)
trap 'rm -rf "$probe"' EXIT
echo 'pub fn probe(n: u32) -> u32 { n + 1 }' >"$probe/probe.rs"
RUSTC_BOOTSTRAP=1 rustc $flags --target "$host" --crate-type lib -o "$probe/probe.rlib" "$probe/probe.rs" 2>"$probe/errors" ||
  cannot "$(head -n 1 "$probe/errors")"

# With --target the flags are for the program alone, not for build scripts.
RUSTC_BOOTSTRAP=1 RUSTFLAGS=$flags \
  cargo build --release --quiet --target "$host" --target-dir "$out" $(printf -- '--bin %s ' "${targets[@]}")
! command -v python3 >/dev/null || python3 seeds.py >/dev/null

# What a session takes for voices is not touched as long as nobody speaks; large pieces come from the system, which knows.
export MALLOC_MMAP_THRESHOLD_=1048576
limits=(-rss_limit_mb=3072 -malloc_limit_mb=1536 -timeout=120 -print_final_stats=1 -verbosity=0 -entropic=0)
for target in "${targets[@]}"; do
  program=$out/$host/release/$target
  work=target/work/$target
  mkdir -p "corpus/$target" "artifacts/$target" "$work"
  if [ -n "$replay" ]; then
    "$program" "${limits[@]}" "$replay"
    continue
  fi
  # New inputs go to the folder of work, or nowhere; seeds stay as they are.
  case $target in
  bundle_bytes) run=(-max_len=150000) ;;
  bundle_lies) run=(-max_len=64) ;;
  session | capi) run=(-max_len=512) ;;
  *) run=(-max_len=4096) ;;
  esac
  if [ -n "${RUNS:-}" ]; then
    rm -rf "$probe/new" && mkdir "$probe/new"
    run+=(-runs="$RUNS" -seed=1 "$probe/new")
  else
    run+=(-max_total_time="$seconds" "$work")
  fi
  echo "== $target"
  status=0
  "$program" "${limits[@]}" -artifact_prefix="artifacts/$target/" "${run[@]}" "corpus/$target" >"$work.log" 2>&1 || status=$?
  grep -E '^(stat::number_of_executed_units|stat::average_exec_per_sec|stat::peak_rss_mb|==[0-9]+==|SUMMARY|.*panicked)' "$work.log" || true
  [ "$status" = 0 ] || { echo "fuzz/$target: exit code $status; see fuzz/artifacts/$target" >&2; exit 1; }
done
