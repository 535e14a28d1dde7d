#!/usr/bin/env bash
# Runs tests under a sanitizer: tests/sanitize.sh address|thread|realtime [kernels|full]
#
#   address   AddressSanitizer with leak detection: kernels, pool, sessions, readers
#   thread    ThreadSanitizer: the fork-join pool and sessions with two threads; the standard library is not instrumented,
#             tests/tsan.supp names what that hides
#   realtime  RealtimeSanitizer: every block of the real-time tests, where any allocation, lock or blocking call is fatal but the
#             yield that tests/rtsan.supp names
#
# No nightly toolchain: flags that stable compilers accept with RUSTC_BOOTSTRAP. `kernels` (address) is the shortest part;
# `full` runs all tests of the library and of tests/ but those that put processes under limits of their own. A toolchain
# without the sanitizer's runtime is skipped with a note. The standard library is the toolchain's own, not rebuilt with the sanitizer: that
# takes the sources of the standard library (rust-src) and -Zbuild-std. Each kind builds the crate anew, in target/sanitize/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
kind=${1:-}
case $kind in address | thread | realtime) ;; *) sed -n '2,14s/^# \{0,1\}//p' "$0"; exit 2 ;; esac

host=$(rustc -vV | sed -n 's/^host: //p')
names=(address=asan thread=tsan realtime=rtsan)
for name in "${names[@]}"; do [ "${name%=*}" != "$kind" ] || short=${name#*=}; done
runtime=$(rustc --print target-libdir)/librustc-stable_rt.$short.a
if [ ! -e "$runtime" ] && ! ls "$(rustc --print target-libdir)"/librustc*_rt."$short".a >/dev/null 2>&1; then
  echo "skipped: this toolchain has no runtime for -Zsanitizer=$kind"
  exit 0
fi

export RUSTC_BOOTSTRAP=1 RUSTFLAGS="-Zsanitizer=$kind"
export CARGO_PROFILE_TEST_DEBUG=line-tables-only
export RTSAN_OPTIONS="suppressions=$PWD/tests/rtsan.supp"
export ASAN_OPTIONS=detect_leaks=1:abort_on_error=0 TSAN_OPTIONS="suppressions=$PWD/tests/tsan.supp halt_on_error=1"
cargo=(cargo test --quiet --target "$host" --target-dir "target/sanitize/$kind" -p visavis)
case $kind in
address)
  parts=(kernels:: par::)
  [ "${2:-}" = kernels ] || parts+=(session:: pose:: audio:: bundle:: nn:: flow:: vae::)
  "${cargo[@]}" --lib -- "${parts[@]}"
  [ "${2:-}" != full ] || "${cargo[@]}" --lib --test session --test governor --test bad_input --test parity --test long_run
  ;;
thread)
  RUSTFLAGS+=' -Cunsafe-allow-abi-mismatch=sanitizer' "${cargo[@]}" --lib -- par:: kernels::exec session::
  [ "${2:-}" != full ] || RUSTFLAGS+=' -Cunsafe-allow-abi-mismatch=sanitizer' "${cargo[@]}" --test session --test governor --test team
  ;;
realtime)
  RUSTFLAGS+=' --cfg visavis_rtsan' "${cargo[@]}" --test realtime --test governor
  ;;
esac
