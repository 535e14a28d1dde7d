"""Film strips of bodies at rest beside each other: a real person, and agents whose user stands and says nothing.

    visavis generate --user-path STILL.csv --model B.safetensors --out DIR
    python -m visavis_train.train.strip --person CLIP --motion NAME=DIR/motion.bvh ... --out strip.png [--seconds 24]

A row a body: a figure every two seconds, seen from the front, in orange the hands' paths of the two seconds after it; below it the speed of the
faster hand relative to the hips (`corpus/measures.py`) with the 3 cm/s below which hands are still.
"""
import argparse

import matplotlib
import numpy as np

from ..corpus import measures, store
from ..motion import rig
from ..motion.bvh import read_bvh

EVERY = 60  # frames between figures


def of_clip(path):
    """Joint positions [T, J, 3] and headings [T] of a clip of a corpus."""
    clip = store.load(path, voices=False)
    return clip.positions.astype(np.float64), rig.yaw_of(rig.quat_to_mat(clip.rotations[:, 0]))


def of_bvh(path):
    """The same of a BVH file that the runtime wrote, which is in centimetres."""
    take = read_bvh(path)
    positions, rotations = take.fk()
    joints = [take.skeleton.names.index(name) for name in rig.NAMES]
    return positions[:, joints] / 100, rig.yaw_of(rotations[:, joints[0]])


def drawn(positions, yaw):
    """What a row shows: joints from the front, over the hips [T, J, 2], and the faster hand's speed [T]."""
    turned = np.einsum("tab,tjb->tja", rig.axis_mat("y", -np.full(len(yaw), yaw.mean())), positions - positions[:, :1] * [1, 0, 1])
    speed = measures.tracks(positions, rig.axis_mat("y", yaw)[:, None])["hand_v"].max(1)
    return turned[..., :2] * [-1, 1], speed


def sheet(path, rows):
    """Draws rows (title, positions [T, J, 3], headings [T])."""
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    columns = min(len(p) for _, p, _ in rows) // EVERY
    fig = plt.figure(figsize=(1.05 * columns, 2.9 * len(rows)))
    grid = fig.add_gridspec(2 * len(rows), columns, height_ratios=[2.2, 0.7] * len(rows), hspace=0.32, wspace=0, left=0.05, right=0.99, top=0.96, bottom=0.04)
    for r, (title, positions, yaw) in enumerate(rows):
        points, speed = drawn(positions, yaw)
        for c in range(columns):
            ax, body = fig.add_subplot(grid[2 * r, c]), points[c * EVERY]
            for j, parent in enumerate(rig.PARENTS):
                if parent >= 0:
                    ax.plot(*body[[parent, j]].T, color="#24476b", lw=1.6, solid_capstyle="round")
            ax.add_patch(plt.Circle(body[measures.HEAD] + [0, 0.08], 0.09, fc="none", ec="#24476b", lw=1.4))
            for hand in measures.HANDS:
                ax.plot(*points[c * EVERY:(c + 1) * EVERY, hand].T, color="#d08020", lw=1.0)
            ax.set(aspect="equal", xlim=(-0.55, 0.55), ylim=(-0.02, 1.75))
            ax.set_axis_off()
            if c == 0:
                ax.text(0, 1.02, title, transform=ax.transAxes, fontsize=9)
        ax = fig.add_subplot(grid[2 * r + 1, :])
        t = np.arange(columns * EVERY) / 30
        ax.fill_between(t, 100 * speed[:len(t)], color="#24476b", lw=0)
        ax.axhline(100 * measures.STILL, color="#d08020", lw=0.8)
        ax.set(xlim=(0, t[-1]), ylim=(0, 60), yticks=(0, 30, 60))
        ax.set_ylabel("cm/s", fontsize=7)
        ax.tick_params(labelsize=7)
    fig.savefig(path, dpi=80)
    plt.close(fig)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--person", required=True, help="clip of a person at rest")
    parser.add_argument("--motion", action="append", default=[], metavar="NAME=BVH")
    parser.add_argument("--out", required=True)
    parser.add_argument("--seconds", type=float, default=24)
    parser.add_argument("--from", dest="start", type=float, default=10, help="second that is shown first [10]")
    args = parser.parse_args()
    first, last = round(args.start * rig.FPS), round((args.start + args.seconds) * rig.FPS)
    given = [("a person who stands about", of_clip(args.person))] + [(name, of_bvh(path)) for name, _, path in (m.partition("=") for m in args.motion)]
    rows = [(name, positions[first:last], yaw[first:last]) for name, (positions, yaw) in given]
    sheet(args.out, rows)
    for name, positions, yaw in rows:
        print(f"{name}: both hands still {(drawn(positions, yaw)[1] < measures.STILL).mean():.2f} of the time")


if __name__ == "__main__":
    main()
