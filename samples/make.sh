#!/bin/sh
# Makes agent.wav, user.wav and user.csv beside this script. Needs espeak-ng, sox and python3 (Debian packages).
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

turn=0
grep -v '^#' "$here/dialogue.tsv" | while IFS='	' read -r speaker _ text; do
    case $speaker in
    agent) voice=en-us+f3 pitch=52 speed=168 ;;
    user) voice=en-gb+m3 pitch=40 speed=172 ;;
    *) echo "dialogue.tsv: unknown speaker $speaker" >&2 && exit 1 ;;
    esac
    espeak-ng -v "$voice" -p "$pitch" -s "$speed" -w "$work/raw.wav" "$text"
    # 16 kHz without dither (the same bits every time), silence at both ends cut, peaks at -6 dB.
    sox -R -D "$work/raw.wav" -r 16000 -b 16 "$work/$(printf %02d $turn).wav" \
        silence 1 0.01 0.5% reverse silence 1 0.01 0.5% reverse gain -n -6
    turn=$((turn + 1))
done
python3 "$here/make.py" "$here/dialogue.tsv" "$work" "$here"
