"""Instructions, int8 multiply-adds and bytes of a block on arm64, counted under qemu; see `count`.

    python -m budget DIR [base|paper ...]     runs what DIR/counts.json lacks and prints Markdown tables

A block is a whole one: two voices, conditioning, evaluations, decoder, pose; no re-anchoring. Histories grow through a run, and attention is the one part
that grows with them, by a fixed number of instructions a token; so later blocks are fitted by a line and read at the full window.
"""
import json
import os
import re
import subprocess
import sys

from peers import weights

CPU = {"dotprod": "cortex-a76", "i8mm": "max,sve=off,sme=off"}
RUNS = {"base": 6, "paper": 4}  # blocks counted of a run
SAMPLERS = ("midpoint4", "midpoint2", "single")
IDLE = 16  # blocks of idle clip: the decoder's window is full from the start
ASSUMED = 1.5  # instructions a clock
TIME = 4 / 30 * 2 / 3  # seconds that a block may take: two thirds of one core


def bundle(folder, size, scheme):
    ours = f"{os.environ['VISAVIS_PEERS_BIN']}/ours"
    plain, path = (f"{folder}/{size}-{s}.safetensors" for s in ("f32", scheme))
    if not os.path.exists(path):
        if not os.path.exists(plain):
            weights.write(plain, json.loads(subprocess.run([ours, "config", size], check=True, capture_output=True).stdout), idle=4 * IDLE)
        subprocess.run([ours, "quantize", plain, path, scheme], check=True)
    return path


def run(folder, size, scheme, sampler, level):
    qemu = ["qemu-aarch64", "-cpu", CPU[level], "-L", os.environ["ARM64_ROOT"], "-plugin", f"{folder}/insn.so"]
    command = [*qemu, f"{os.environ['VISAVIS_ARM64_BIN']}/ours", "count", bundle(folder, size, scheme), sampler, str(RUNS[size])]
    done = subprocess.run(command, capture_output=True, text=True, env=dict(os.environ, VISAVIS_CPU=level))
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}: {done.stderr[-400:]}")
    counts = [list(map(int, m)) for m in re.findall(r"^insn (\d+) (\d+) (\d+)$", done.stderr, re.M)][1::2]  # between two markers of a block
    return {"counts": counts, **json.loads(done.stdout)}


def at_full_window(r):
    """(instructions, multiply-adds, 16-byte loads) of a block whose window is full: a line through the later blocks of a run."""
    rows, window = r["counts"][2:], r["flow"]["window_blocks"]
    n, first = len(rows), r["idle_blocks"] + 3  # tokens that block 2 attends to
    out = []
    for i in range(3):
        y = [c[i] for c in rows]
        slope = (y[-1] - y[0]) / (n - 1)
        out.append(y[0] + slope * (window - first))
    return out


def cache_bytes(r):
    """fp16 keys and values that a block reads: every evaluation its ring in full, the decoder its."""
    f, v = r["flow"], r["vae"]
    branches = 1 if r["sampler"] == "single" else 2
    return r["evaluations"] * branches * f["layers"] * 2 * 2 * f["window_blocks"] * f["width"] + v["layers"] * 2 * 2 * 5 * v["window_blocks"] * v["width"]


def main():
    folder, sizes = sys.argv[1], sys.argv[2:]
    path = f"{folder}/counts.json"
    known = json.load(open(path)) if os.path.exists(path) else {}
    for size in sizes:
        for level in CPU:
            for scheme in ("i8", "i4"):
                for sampler in SAMPLERS:
                    key = f"{size} {scheme} {sampler} {level}"
                    if key not in known:
                        known[key] = run(folder, size, scheme, sampler, level)
                        with open(path, "w") as f:
                            json.dump(known, f, indent=1)
                        print(f"counted {key}", file=sys.stderr, flush=True)
    print(table(known), projection(known), sep="\n\n")


def table(known):
    """A row a size, scheme and sampler: what a block takes, and what it asks of one core that has a third to spare."""
    lines = ["| size, scheme, sampler | weights, MB | caches, MB | int8 MAC, M | instructions, M: dotprod | i8mm | GHz x instructions a clock: dotprod | i8mm | GB/s |",
             "|---|---|---|---|---|---|---|---|---|"]
    for size in RUNS:
        for scheme in ("i8", "i4"):
            for sampler in SAMPLERS:
                rows = {level: known.get(f"{size} {scheme} {sampler} {level}") for level in CPU}
                if None in rows.values():
                    continue
                dot, mm = (at_full_window(rows[level]) for level in CPU)
                r = rows["dotprod"]
                lines.append(f"| {size}, {scheme}, {sampler} | {r['weight_bytes'] / 1e6:.1f} | {cache_bytes(r) / 1e6:.1f} | {dot[1] / 1e6:.0f} | {dot[0] / 1e6:.1f} | {mm[0] / 1e6:.1f} "
                             f"| {dot[0] / TIME / 1e9:.2f} | {mm[0] / TIME / 1e9:.2f} | {(r['weight_bytes'] + cache_bytes(r)) / TIME / 1e9:.2f} |")
    return "\n".join(lines)


def projection(known):
    """Share of one core for a block, dotprod kernels: assumed instructions a clock, published clock and factors (docs/headset-budget.md)."""
    cores = {"XR2 Gen 1": 2.42e9, "XR2 Gen 2": 1.33 * 2.42e9, "XR2+ Gen 2": 1.2 * 1.33 * 2.42e9}
    lines = [f"| share of one core | {' | '.join(cores)} | memory, GB/s, on average |", "|---|" + "---|" * (len(cores) + 1)]
    for key, r in known.items():
        size, scheme, sampler, level = key.split()
        if level == "dotprod":
            shares = [f"{100 * at_full_window(r)[0] / (ASSUMED * hertz) / (4 / 30):.0f} %" for hertz in cores.values()]
            lines.append(f"| {size}, {scheme}, {sampler} | {' | '.join(shares)} | {(r['weight_bytes'] + cache_bytes(r)) / (4 / 30) / 1e9:.2f} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
