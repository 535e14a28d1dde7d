#!/usr/bin/env bash
# Opens a generated viewer page in headless Chromium, with WebGL and on the 2-D canvas, wide and phone-sized, and fails unless
# each time the page becomes ready without a JavaScript error.
#   tests/viewer/check.sh out/demo/index.html [folder for screenshots [told | mixed]]
# `told`: the page's frames tell whom the body follows; `mixed`: those from 10 to 20 s alone. Else none does.
# CHROMIUM names the browser (default: chromium, then google-chrome).
set -euo pipefail

page=${1:?usage: check.sh PAGE.html [SCREENSHOT_FOLDER]}
[ -s "$page" ] || { echo "$page: no such page" >&2; exit 1; }
url="file://$(realpath "$page")"
shots=${2:-}
tells=${3:-none}
browser=${CHROMIUM:-$(command -v chromium || command -v google-chrome || true)}
[ -n "$browser" ] || { echo "no Chromium found: install it or set CHROMIUM" >&2; exit 1; }
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

open() { # open SIZE HASH EXTRA...: runs the browser on the page
    local size=$1 hash=$2
    shift 2
    timeout 180 "$browser" --headless --no-sandbox --disable-gpu --use-angle=swiftshader --enable-unsafe-swiftshader \
        --disable-background-networking --disable-dev-shm-usage --user-data-dir="$scratch/profile" --hide-scrollbars \
        --virtual-time-budget=3000 --window-size="$size" "$@" "$url#$hash" 2>"$scratch/log"
}

status=0
# check NAME SIZE HASH RENDERER [WHOM]: the state the page reports about itself. WHOM: how much of the joint that is looked at follows the user, as a
# pattern; `none` where the body is not coloured.
check() {
    local name=$1 size=$2 hash=$3 renderer=$4 whom=${5:-none} tag
    open "$size" "$hash" --dump-dom >"$scratch/dom" || true
    tag=$(grep -o '<html[^>]*>' "$scratch/dom" | head -1 || true)
    if [[ $tag == *'data-state="ready"'* && $tag == *'data-errors="0"'* && $tag == *"data-renderer=\"$renderer\""* &&
        $tag == *data-whom=\"$whom\"* ]]; then
        echo "ok   $name"
    else
        echo "FAIL $name: ${tag:-no page}" >&2
        grep -o 'id="failure"[^<]*<' "$scratch/dom" >&2 || tail -3 "$scratch/log" >&2
        status=1
    fi
    if [ -n "$shots" ]; then
        mkdir -p "$shots"
        open "$size" "$hash" --screenshot="$(realpath "$shots")/$name.png" >/dev/null || status=1
    fi
}

share='[01].[0-9][0-9][0-9]'
case $tells in
none)
    check webgl-wide 1440,900 't=8.5&theme=dark' webgl2
    check webgl-light 1440,900 't=13&theme=light&cam=-60,10,4' webgl2
    check webgl-phone 412,860 't=8.5&theme=dark' webgl2
    check webgl-user 1280,720 't=8.5&view=user&theme=dark&joints' webgl2
    check webgl-plays 1280,720 'play&speed=2&theme=dark' webgl2
    check canvas-wide 1440,900 't=8.5&fallback&theme=dark' canvas2d
    check canvas-phone 412,860 't=8.5&fallback&theme=light' canvas2d
    ;;
told)
    check told-wide 1440,900 't=14&theme=dark' webgl2 "$share"
    check told-joint 1440,900 't=14&theme=light&joint=leftUpperArm' webgl2 "$share"
    check told-off 1440,900 't=14&theme=dark&whom=0' webgl2
    check told-phone 412,860 't=14&theme=dark&joints' webgl2 "$share"
    check told-canvas 1440,900 't=14&theme=dark&fallback&joint=head' canvas2d "$share"
    ;;
mixed)
    check mixed-before 1440,900 't=5&theme=dark&joint=head' webgl2
    check mixed-told 1440,900 't=15&theme=dark&joint=head' webgl2 "$share"
    check mixed-after 1440,900 't=25&theme=light&fallback' canvas2d
    ;;
*)
    echo "told or mixed, not $tells" >&2
    exit 2
    ;;
esac
exit $status
