# What .ci/run and .ci/full share: titled steps with their times, packages, the Python environment. Sourced, from the root.
# shellcheck shell=bash
cache=${XDG_CACHE_HOME:-$HOME/.cache}/visavis
kit=../shared/android
mkdir -p "$cache"

title=''
started=$SECONDS
report=()
finish() {
  [ -n "$title" ] || return 0
  report+=("$(printf '%5d s  %s' $((SECONDS - started)) "$title")")
  printf -- '-- %d s\n' $((SECONDS - started))
}
step() {
  finish
  title=$1 started=$SECONDS
  printf '\n== %s\n' "$title"
}
skip() { echo "skipped: $*"; }
passed() {
  finish
  printf '\nAll checks passed in %d s:\n' "$SECONDS"
  printf '%s\n' "${report[@]}"
}
trap 'code=$?; if [ $code != 0 ]; then printf "\nFAILED (exit code %d) in: %s\n" $code "${title:-start}" >&2; fi' EXIT

# packages COMMAND=PACKAGES...: installs from Debian, as root, what has no such command.
packages() {
  local wanted=() pair
  for pair in "$@"; do
    # shellcheck disable=SC2206
    command -v "${pair%%=*}" >/dev/null || wanted+=(${pair#*=})
  done
  python3 -c 'import venv, ensurepip' 2>/dev/null || wanted+=(python3 python3-venv)
  if [ ${#wanted[@]} -gt 0 ]; then
    echo "installing ${wanted[*]}"
    export DEBIAN_FRONTEND=noninteractive
    apt-get -qq update
    apt-get -qq install -y --no-install-recommends "${wanted[@]}" >"$cache/apt.log" 2>&1 || { tail -30 "$cache/apt.log" >&2; exit 1; }
  fi
  for component in rustfmt clippy; do
    cargo "${component/rustfmt/fmt}" --version >/dev/null 2>&1 || rustup component add "$component"
  done
}

# python_environment: sets $python, with the training package's dependencies; takes minutes where there is none.
venv=${VISAVIS_VENV:-$cache/venv}
python=$venv/bin/python
python_environment() {
  "$python" -c 'import torch, numpy, scipy, safetensors, matplotlib, pytest' 2>/dev/null && return
  python3 -m venv "$venv"
  "$venv/bin/pip" install --quiet './training[test]'
  # The checkout is what is tested, not the copy that came with its dependencies.
  "$venv/bin/pip" uninstall --quiet --yes visavis-train
}
