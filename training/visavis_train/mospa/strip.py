"""Film strips of reactions: a figure every half second, obliquely from the front, and the way and headings from above with the source.

    python -m visavis_train.mospa.strip --corpus DIR --split test --clips 0,30,47 --out strip.png
    python -m visavis_train.mospa.strip --corpus DIR --split test --clips 0,30,47 --net runs/mospa.pt --steps 100 --out strip.png     the model's answers below
"""
import argparse
import json
import os

import matplotlib
import numpy as np

from ..motion import rig
from . import layout

EVERY, AZIMUTH, RISE = 15, 0.6, 0.25        # frames between figures; where the camera stands
LEFT = {rig.INDEX[n] for n in rig.NAMES if n.startswith("left")}


def seen(p):
    """Points [..., 3] on the picture: horizontally, vertically."""
    x = np.cos(AZIMUTH) * p[..., 0] - np.sin(AZIMUTH) * p[..., 2]
    z = np.sin(AZIMUTH) * p[..., 0] + np.cos(AZIMUTH) * p[..., 2]
    return np.stack([-x, p[..., 1] * np.cos(RISE) - z * np.sin(RISE)], -1)


def sheet(path, rows):
    """Draws rows (title, positions [T, J, 3], headings [T], source [3], onset in frames)."""
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    columns = len(rows[0][1]) // EVERY
    fig, axes = plt.subplots(len(rows), columns + 2, figsize=(0.95 * columns + 2.6, 1.9 * len(rows)), gridspec_kw={"wspace": 0, "hspace": 0.25, "width_ratios": [1.9, 0.1] + [1] * columns})
    for (title, p, yaw, source, onset), row in zip(rows, np.atleast_2d(axes)):
        ax = row[0]
        ax.plot(-p[:, 0, 0], p[:, 0, 2], color="#24476b", lw=1)
        for t in range(0, len(p), EVERY):
            ax.plot([-p[t, 0, 0], -p[t, 0, 0] - 0.4 * np.sin(yaw[t])], [p[t, 0, 2], p[t, 0, 2] + 0.4 * np.cos(yaw[t])], color="#24476b" if t >= onset else "#999999", lw=0.8)
        ax.plot(-source[0], source[2], "*", color="#d08020", ms=9)
        ax.set(aspect="equal")
        reach = max(2.5, np.abs(p[:, 0]).max(), np.abs(source[[0, 2]]).max()) + 0.5
        ax.set(xlim=(-reach, reach), ylim=(-reach, reach), xticks=[], yticks=[])
        ax.set_title(title, fontsize=8, loc="left")
        row[1].set_axis_off()
        for c, ax in enumerate(row[2:]):
            t = c * EVERY
            body = seen(p[t] - p[t, :1] * [1, 0, 1])
            for j, parent in enumerate(rig.PARENTS):
                if parent >= 0:
                    ax.plot(*body[[parent, j]].T, color="#8a2f2f" if j in LEFT else "#24476b", lw=1.5, solid_capstyle="round")
            ax.add_patch(plt.Circle(body[rig.INDEX["head"]] + [0, 0.08], 0.09, fc="none", ec="#24476b", lw=1.2))
            ax.set(aspect="equal", xlim=(-0.6, 0.6), ylim=(-0.3, 1.85))
            ax.set_axis_off()
            if onset <= t < onset + EVERY:
                ax.plot(0, 1.85, "*", color="#d08020", ms=6)
    fig.savefig(path, dpi=75, bbox_inches="tight")
    plt.close(fig)


def row(title, x, source, onset):
    p, r = layout.to_world(x)
    return title, p, rig.yaw_of(r[:, 0]), source, onset


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--split", default="test")
    parser.add_argument("--clips", default="0,1,2,3")
    parser.add_argument("--net", help="checkpoint of mospa.train")
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--out", required=True)
    args = parser.parse_args()
    place, which = os.path.join(args.corpus, args.split), [int(i) for i in args.clips.split(",")]
    with open(os.path.join(place, "clips.json")) as f:
        clips = json.load(f)
    motion, location = (np.load(os.path.join(place, k + ".npy"), mmap_mode="r") for k in ("motion", "location"))
    rows = [(i, row(f"{i} {clips[i]['class']}, {clips[i]['genre']}: {clips[i]['reaction']}", motion[i], location[i], 30 * clips[i]["onset"])) for i in which]
    if args.net:
        from . import data, diffusion, train
        net, _ = train.load(args.net)
        split = data.Split(args.corpus, args.split)
        made = diffusion.motions(net, split, which, args.steps)
        rows += [(i, row(f"{i} model, {args.steps} steps", made[k], location[i], 30 * clips[i]["onset"])) for k, i in enumerate(which)]
    sheet(args.out, [r for _, r in sorted(rows, key=lambda x: which.index(x[0]))])


if __name__ == "__main__":
    main()
