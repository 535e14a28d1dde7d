#!/usr/bin/env bash
# Runs tests under a sanitizer: tests/sanitize.sh address|thread|realtime [kernels|faces|full]
#
#   address   AddressSanitizer with leak detection: kernels, pool, sessions, readers
#   thread    ThreadSanitizer: the fork-join pool and sessions with two threads; the standard library is not instrumented,
#             tests/tsan.supp names what that hides
#   realtime  RealtimeSanitizer: every block of the real-time tests, where any allocation, lock or blocking call is fatal but the
#             yield that tests/rtsan.supp names
#
# `faces` (address, thread): inputs pushed into from several threads, in Rust, in C and as JNI does it, two threads from one buffer; with
# address also the JNI library in a JVM, where there is one.
#
# No nightly toolchain: flags that stable compilers accept with RUSTC_BOOTSTRAP. `kernels` (address) is the shortest part;
# `full` runs all tests of the library and of tests/ but those that put processes under limits of their own. A toolchain
# without the sanitizer's runtime is skipped with a note. The standard library is the toolchain's own, not rebuilt with the sanitizer: that
# takes the sources of the standard library (rust-src) and -Zbuild-std. Each kind builds the crate anew, in target/sanitize/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
kind=${1:-}
case $kind in address | thread | realtime) ;; *) sed -n '2,18s/^# \{0,1\}//p' "$0"; exit 2 ;; esac

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
# Instrumented code is linked to a standard library that is not.
[ "$kind" != thread ] || RUSTFLAGS+=' -Cunsafe-allow-abi-mismatch=sanitizer'
build=(--quiet --target "$host" --target-dir "target/sanitize/$kind")
cargo=(cargo test "${build[@]}" -p visavis)

faces() {
  "${cargo[@]}" --lib -- queue:: audio::tests user::
  "${cargo[@]}" --test inputs
  cargo test "${build[@]}" -p visavis-capi --test threads
  cargo test "${build[@]}" -p visavis-android
}
# The whole JNI library under the address sanitizer, preloaded into a JVM, whose own faults are its own business.
jvm() {
  local asan classes=target/sanitize/classes
  asan=$(cc -print-file-name=libasan.so)
  if ! command -v javac >/dev/null || [ ! -e "$asan" ]; then
    echo 'skipped: the JNI library in a JVM (there is no javac, or no shared runtime of the address sanitizer)'
    return
  fi
  mkdir -p "$classes"
  javac -d "$classes" $(find android/check/stubs android/visavis/src/main/java android/demo/src/main/java android/check/java -name '*.java')
  cargo build "${build[@]}" -p visavis-android
  LD_PRELOAD=$asan ASAN_OPTIONS=detect_leaks=0:handle_segv=0:allow_user_segv_handler=1:abort_on_error=0 \
    java -Djava.library.path="target/sanitize/address/$host/debug" -cp "$classes" org.visavis.Check tests/goldens/tiny.safetensors 20 2 |
    grep 'tests passed'
}
if [ "${2:-}" = faces ]; then
  [ "$kind" != realtime ] || { echo 'faces: address or thread' >&2; exit 2; }
  faces
  [ "$kind" != address ] || jvm
  exit
fi
case $kind in
address)
  parts=(kernels:: par::)
  [ "${2:-}" = kernels ] || parts+=(session:: pose:: audio:: bundle:: nn:: flow:: vae::)
  "${cargo[@]}" --lib -- "${parts[@]}"
  [ "${2:-}" != full ] || "${cargo[@]}" --lib --test session --test governor --test bad_input --test parity --test long_run
  [ "${2:-}" != full ] || { faces && jvm; }
  ;;
thread)
  "${cargo[@]}" --lib -- par:: kernels::exec session:: queue::
  [ "${2:-}" != full ] || "${cargo[@]}" --test session --test governor --test team
  [ "${2:-}" != full ] || faces
  ;;
realtime)
  RUSTFLAGS+=' --cfg visavis_rtsan' "${cargo[@]}" --test realtime --test governor
  ;;
esac
