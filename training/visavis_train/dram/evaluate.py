"""The paper's table and figure on a corpus' test split, and what a model does running freely.

    python -m visavis_train.dram.evaluate --data WORK/dram --table runs/table [--out table.json]
    python -m visavis_train.dram.evaluate --data WORK/dram --model runs/dram-tcn.pt runs/dram-lstm.pt

APE: mean distance of twelve points from the recorded ones relative to the hips, over roll-outs of 4.3 s that begin with 3.2 s of recorded poses; PCK: share of points
within a distance. Tests are paired over clips (windows of one clip are not independent), two-tailed.
"""
import argparse
import json
import os

import numpy as np
import torch

from . import measure, nets, roll, train
from .data import Split

THRESHOLDS = (1, 2, 3, 5, 7, 10, 15)


def table(folder, data, windows):
    errors, rows = {}, []
    for variant in nets.VARIANTS:
        for kind in ("lstm", "tcn"):
            path = os.path.join(folder, f"{variant}-{kind}.pt")
            if os.path.exists(path):
                net, layout, state = train.load(path)
                e, clips = measure.position_errors(net, layout, data, windows)
                errors[variant, kind] = measure.by_clip(e.mean((1, 2)).numpy(), clips)
                rows.append({"variant": variant, "backbone": kind, "parameters": sum(p.numel() for p in net.parameters()), "steps": state["step"],
                             "ape": float(errors[variant, kind].mean()),
                             "groups": dict(zip(measure.GROUPS, measure.group_errors(e).mean((0, 1)).tolist())),
                             "pck": {t: (e <= t).float().mean().item() for t in THRESHOLDS}})
    for row in rows:
        if (best := errors.get(("dram", row["backbone"]))) is not None and row["variant"] != "dram":
            d, se, p = measure.paired(errors[row["variant"], row["backbone"]], best)
            row |= {"above dram": d, "se": se, "p": p}
    return {"windows": windows, "clips": len(next(iter(errors.values()))), "rows": rows}


def show_table(t):
    print(f"APE in cm, {t['windows']} windows of {t['clips']} clips")
    print("| model | backbone | mean | " + " | ".join(measure.GROUPS) + " | above DRAM (p) | PCK " + ", ".join(map(str, THRESHOLDS)) + " cm |")
    for r in t["rows"]:
        above = f"{r['above dram']:+.2f} ± {r['se']:.2f} ({r['p']:.3f})" if "p" in r else "-"
        print(f"| {r['variant']} | {r['backbone']} | {r['ape']:.2f} | " + " | ".join(f"{v:.2f}" for v in r["groups"].values()) + f" | {above} | "
              + " ".join(f"{v:.2f}" for v in r["pck"].values()) + " |")


def attention(net, layout, data, windows, own):
    found, out = measure.deltas(net, layout, data, windows, own=own), {}
    still = found["silent and still"]
    for name, of in found.items():
        both = sorted(set(of) & set(still))
        a, b = (np.array([m[c] for c in both]) for m in (of, still))
        out[name] = {"delta": float(np.mean([v[0] for v in of.values()])), "head": float(np.mean([v[1] for v in of.values()])), "clips": len(of)}
        if name != "silent and still" and len(both) > 2:
            out[name] |= {"above silence": measure.paired(a[:, 0], b[:, 0]), "head above silence": measure.paired(a[:, 1], b[:, 1])}
    return out


@torch.no_grad()
def running(net, layout, data, windows, frames, gaze=None):
    """Free-running figures and the corpus' own."""
    first, places = 96, data.spread(windows, 96 + frames)
    w = data.at([c for c, _ in places], [a for _, a in places], first + frames)
    if gaze is not None:
        w.flags[:, 4], w.wanted = 1.0, torch.full_like(w.wanted, gaze)
    y, _, roots = roll.free(net, w, layout, first, first + frames)
    return measure.liveliness(y, roots, w, first), measure.liveliness(w.y[:, first:], w.roots[:, first:], w, first)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", required=True)
    parser.add_argument("--table", help="folder of visavis_train.dram.train --table")
    parser.add_argument("--model", nargs="*", default=[], help="checkpoints of the whole body")
    parser.add_argument("--split", default="test")
    parser.add_argument("--windows", type=int, default=256)
    parser.add_argument("--seconds", type=float, default=30, help="of free running [30]")
    parser.add_argument("--out", help="writes all figures as JSON")
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    data, found = Split(args.data, args.split), {}
    if args.table:
        found["table"] = table(args.table, data, args.windows)
        show_table(found["table"])
    for path in args.model:
        net, layout, state = train.load(path)
        found[path] = row = {"parameters": sum(p.numel() for p in net.parameters()), "steps": state["step"]}
        e, clips = measure.position_errors(net, layout, data, args.windows)
        row["ape"], row["groups"] = float(e.mean()), dict(zip(measure.GROUPS, measure.group_errors(e).mean((0, 1)).tolist()))
        print(path, "APE", round(row["ape"], 2), {k: round(v, 2) for k, v in row["groups"].items()}, flush=True)
        for own in (False, True):
            row["delta free" if own else "delta"] = a = attention(net, layout, data, args.windows // 2, own)
            for name, v in a.items():
                print("Delta", "free" if own else "forced", name.ljust(17), f"{v['delta']:.3f} head {v['head']:.3f} ({v['clips']} clips)",
                      *(f"{k}: {d:+.4f} ± {s:.4f} (p {p:.2g})" for k in ("above silence", "head above silence") if k in v for d, s, p in [v[k]]), flush=True)
        frames = int(args.seconds * 30)
        for gaze in (None, 0.0, 0.5, 0.9):
            model, corpus = running(net, layout, data, min(args.windows, 48), frames, gaze)
            if gaze is None:
                row["corpus"] = corpus
                print("corpus".ljust(10), {k: round(v, 3) for k, v in corpus.items()})
            row[f"free gaze {gaze}"] = model
            print(f"gaze {gaze}".ljust(10), {k: round(v, 3) for k, v in model.items()}, flush=True)
    if args.out:
        with open(args.out + ".tmp", "w") as f:
            json.dump(found, f, indent=1)
        os.replace(args.out + ".tmp", args.out)


if __name__ == "__main__":
    main()
