#!/usr/bin/env bash
# Runs a Windows program under Debian's Wine, with the rest of its arguments: capi/windows/wine.sh PROGRAM.exe [ARGUMENTS]
# The runner of cargo's tests, too. Paths are of this system (drive Z).
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# Wine 8 has no bcryptprimitives.dll, which Windows has; Wine looks beside the program first.
dll=$(dirname "$1")/bcryptprimitives.dll
if [ ! -f "$dll" ]; then
  x86_64-w64-mingw32-gcc -shared -o "$dll.$$" "$here/random.c" -ladvapi32
  mv "$dll.$$" "$dll"
fi
cache=${XDG_CACHE_HOME:-$HOME/.cache}/visavis
mkdir -p "$cache"
export WINEPREFIX=${WINEPREFIX:-$cache/wine} WINEDEBUG=-all LC_ALL=C.UTF-8
exec /usr/lib/wine/wine64 "$@"
