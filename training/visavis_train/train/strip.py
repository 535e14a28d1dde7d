"""Film strips of bodies at rest beside each other: a real person, and agents whose user stands and says nothing.

    python -m visavis_train.train.strip --person CLIP --bundle NAME=B.safetensors ... --out strip.png [--seconds 24] [--student]

A row a body: a figure every two seconds, seen from the front, in orange the hands' paths of the two seconds after it; below it the speed of the
faster hand relative to the hips (`corpus/measures.py`) with the 3 cm/s below which hands are still.
"""
import argparse

import matplotlib
import numpy as np
import torch

from .. import bundle as bundles
from ..corpus import measures, store
from ..motion import rig
from ..nets.flow import Condition, absent
from ..nets.stream import DecoderStream, Stream
from .geometry import integrate, local_positions, to_local, to_world

EVERY = 60   # frames between figures
AWAY = 1.5   # metres to the user
SETTLE = 150  # frames after an agent's start that are not shown


def rest(b, frames, student=False, seed=0):
    """Joint positions [T, J, 3] and headings [T] of an agent of an open bundle before a user who stands still, both silent."""
    torch.manual_seed(seed)
    session, width = b.config["session"], b.config["audio"]["features"]
    clean = session.get("clean_history") or {"tau": None, "from": 0.0}
    stream = Stream(b.student if student else b.flow, 1, session["guidance"], session["gaze_guidance"], False, 4,
                    b.config["student"]["tau_history"] if student else clean["tau"], clean["from"], student)
    idle, heat = b.encode(b.idle()[None]), session.get("temperature", 1.0)
    stream.warm(idle, torch.randn_like(idle), absent(1, idle.shape[1], width))
    decoder, place = DecoderStream(b.vae.decoder, 1), lambda z: z * b.stat("latent_std") + b.stat("latent_mean")
    for i in range(idle.shape[1]):
        decoder.step(place(idle[:, i:i + 1]))
    root, user, x, roots = torch.zeros(1, 3, dtype=torch.float64), torch.tensor([0.0, AWAY]).double().expand(1, 4, 2), [], []
    for _ in range(-(-frames // 4)):
        quiet = torch.zeros(1, 1, 4 * width)
        cond = Condition(to_local(root, user).float().reshape(1, 1, 8), quiet, quiet, torch.zeros(1, 1, 4), torch.tensor([[[1.0, 0.0, 0.0, 0.0]]]))
        x.append(b.unstandardise(decoder.step(place(stream.step(heat * torch.randn(1, 1, idle.shape[2]), cond))))[0])
        roots.append(integrate(x[-1][:, :3].double(), root[0]))
        root = roots[-1][-1:]
    roots = torch.cat(roots)
    return to_world(roots, local_positions(torch.cat(x)).double()).numpy()[:frames], roots[:frames, 2].numpy()


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
    grid = fig.add_gridspec(2 * len(rows), columns, height_ratios=[2.2, 0.7] * len(rows), hspace=0.18, wspace=0, left=0.05, right=0.99, top=0.96, bottom=0.04)
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
    parser.add_argument("--bundle", action="append", default=[], metavar="NAME=FILE")
    parser.add_argument("--out", required=True)
    parser.add_argument("--seconds", type=float, default=24)
    parser.add_argument("--from", dest="start", type=float, default=10, help="second of the clip that is shown first [10]")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--student", action="store_true", help="agents make each block in one evaluation")
    args = parser.parse_args()
    torch.set_num_threads(1)
    frames, first = round(args.seconds * rig.FPS), round(args.start * rig.FPS)
    clip = store.load(args.person, voices=False)
    body = clip.positions[first:first + frames].astype(np.float64)
    rows = [("a person who stands about", body, rig.yaw_of(rig.quat_to_mat(clip.rotations[first:first + frames, 0])))]
    for given in args.bundle:
        name, _, path = given.partition("=")
        positions, yaw = rest(bundles.read(path), SETTLE + frames, args.student, args.seed)
        rows.append((name, positions[SETTLE:], yaw[SETTLE:]))
    sheet(args.out, rows)
    for name, positions, yaw in rows:
        print(f"{name}: hands still {(drawn(positions, yaw)[1] < measures.STILL).mean():.2f} of the time")


if __name__ == "__main__":
    main()
