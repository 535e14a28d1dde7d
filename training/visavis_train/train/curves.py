"""Draws training logs as pictures: `python -m visavis_train.train.curves runs/*.jsonl --out runs/curves`."""
import argparse
import json
import os

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402


def draw(path, out):
    with open(path) as f:
        rows = [json.loads(line) for line in f]
    names = [k for k in dict.fromkeys(k for r in rows for k in r) if k not in ("step", "minutes", "progress")]
    if not names:
        return
    columns = 4
    lines = -(-len(names) // columns)
    fig, axes = plt.subplots(lines, columns, figsize=(3.2 * columns, 2.2 * lines), squeeze=False)
    for ax in axes.flat[len(names):]:
        ax.set_axis_off()
    for ax, name in zip(axes.flat, names):
        points = [(r["step"], r[name]) for r in rows if name in r]
        ax.plot(*zip(*points), lw=1)
        if min(v for _, v in points) > 0:
            ax.set_yscale("log")
        ax.set_title(name, fontsize=8)
        ax.tick_params(labelsize=6)
    fig.suptitle(os.path.basename(path), fontsize=9)
    fig.tight_layout()
    fig.savefig(out, dpi=80)
    plt.close(fig)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", nargs="+")
    parser.add_argument("--out", required=True, help="folder")
    args = parser.parse_args()
    os.makedirs(args.out, exist_ok=True)
    for path in args.logs:
        draw(path, os.path.join(args.out, os.path.basename(path).replace(".jsonl", "") + ".png"))


if __name__ == "__main__":
    main()
