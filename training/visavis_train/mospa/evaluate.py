"""The paper's table on the simulated test split, and what an onlooker notices.

    python -m visavis_train.mospa.evaluate --corpus WORK/mospa/corpus --extractor runs/extractor.pt --net runs/mospa.pt [--steps 4,100] [--also NAME=runs/small.pt] --out mospa.json

R-precision (32 candidates), FID, diversity (64 pairs) and APD as in the paper's appendix, by our own feature extractor: figures compare these rows with each other and not with
the paper's. Beside them: share of the right reaction by the classifier, angle between the hips' heading and the source 1.5 s after the onset, left and right
confused, reaction time, false alarms.
"""
import argparse
import json

import numpy as np
import torch
from scipy.linalg import sqrtm

from ..motion import rig
from ..train.common import mixed
from . import diffusion, extractor, layout, nets, react, train
from .data import Split, off_source

POOL, PAIRS, DRAWS = 32, 64, 20


def r_precision(conditions, motions, rng):
    """Shares [3] of motions whose own condition is among the nearest one, two, three of 32."""
    n, hits = len(motions), np.zeros(3)
    for _ in range(DRAWS):
        for i in range(n):
            others = rng.choice(np.delete(np.arange(n), i), min(POOL, n) - 1, replace=False)
            d = np.linalg.norm(conditions[np.concatenate([[i], others])] - motions[i], axis=1)
            hits += (d[1:] < d[0]).sum() < np.arange(1, 4)
    return hits / (n * DRAWS)


def fid(a, b):
    """Distance of two Gaussians that fit features [N, 48] and [M, 48]."""
    ca, cb = np.cov(a.T), np.cov(b.T)
    return float(((a.mean(0) - b.mean(0)) ** 2).sum() + np.trace(ca + cb - 2 * sqrtm(ca @ cb).real))


def diversity(motions, rng):
    draw = lambda: motions[rng.choice(len(motions), min(PAIRS, len(motions)), replace=False)]
    return float(np.mean([np.linalg.norm(draw() - draw(), axis=1).mean() for _ in range(DRAWS)]))


def apd(x):
    """Mean distance of two motions [N, T, D], standardised."""
    flat = x.reshape(len(x), -1)
    d = torch.cdist(flat, flat)
    return float(d.sum() / (len(x) * (len(x) - 1)))


def reaction_time(x, clip):
    """Seconds from the onset to where joints, seen from the hips, first move faster than three times what they did before and at least 0.25 m/s; None: never."""
    p, _ = layout.to_world(x)
    v = np.linalg.norm(np.diff(p - p[:, :1], axis=0), axis=-1)[:, 1:].max(1) * 30
    v = np.convolve(v, np.ones(3) / 3, "same")
    first = int(30 * clip["onset"])
    fast = np.flatnonzero(v[first:] > max(0.25, 3 * np.median(v[3:first])))
    return fast[0] / 30 if len(fast) else None


@torch.no_grad()
def row(net, split, which, x, real, conditions, times):
    """Measures of motion x [n, T, D] for clips `which`."""
    rng = np.random.default_rng(0)
    xt = torch.from_numpy(x)
    m = net.of_motion(xt).numpy()
    clips = [split.clips[i] for i in which]
    told = net.reactions(xt).argmax(-1).numpy()
    turning = [k for k, c in enumerate(clips) if c["reaction"] in react.TURNS]
    seen = np.array([off_source(x[k], clips[k], split.location[which[k]]) for k in turning])
    aside = (np.abs(seen[:, 1]) > np.radians(30)) & (np.abs(seen[:, 1]) < np.radians(150)) & (np.abs(seen[:, 2]) > 0.1)
    mine = [reaction_time(x[k], c) for k, c in enumerate(clips)]
    late = [a - b for a, b, c in zip(mine, times, clips) if a is not None and b is not None and c["reaction"] != "stay"]
    silent = [k for k, c in enumerate(clips) if c["class"] == "silence"]
    return {"r_precision": r_precision(conditions, m, rng).round(3).tolist(), "fid": round(fid(m, real), 3), "diversity": round(diversity(m, rng), 3),
            "apd": round(apd(net.standard.standardise(xt)), 2), "right_reaction": round(float((told == split.reaction[which]).mean()), 3),
            "median_angle_deg": round(float(np.degrees(np.median(seen[:, 0]))), 1), "left_right_confused": round(float((np.sign(seen[:, 1]) != np.sign(seen[:, 2]))[aside].mean()), 3),
            "reaction_late_s": round(float(np.median(late)), 3), "false_alarms": round(float((told[silent] != 0).mean()), 3), "clips": len(x)}


def nearest(train_split, split, which, net):
    """Motion of the training clip (or mirror image) whose features, place and sensitivity are nearest."""
    def key(s, some):
        left, right = s.ears(some)
        _, place, genre = s.given(net, some)
        f = [((e - net.feature_mean) / net.feature_std).mean(1) for e in (left, right)]
        return torch.cat([*f, 6 * place[:, :3], 6 * torch.nn.functional.one_hot(genre, nets.UNKNOWN)], -1)
    every = torch.cat([key(train_split, list(range(a, min(a + 128, 2 * len(train_split))))) for a in range(0, 2 * len(train_split), 128)])
    return train_split.poses(torch.cdist(key(split, which), every).argmin(1).tolist())


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--extractor", required=True)
    parser.add_argument("--net", required=True)
    parser.add_argument("--steps", default="4,100,1000")
    parser.add_argument("--also", action="append", default=[], metavar="NAME=CHECKPOINT", help="another network, at the first of --steps")
    parser.add_argument("--motion", action="append", default=[], metavar="NAME=FILE", help="motion of the test clips [N, 240, 264], .npy (`mospa.streamed`)")
    parser.add_argument("--clips", type=int, help="the first so many test clips [all]")
    parser.add_argument("--out", required=True)
    args = parser.parse_args()
    torch.set_num_threads(1)
    held, data, judge = Split(args.corpus, "test"), Split(args.corpus, "train"), extractor.load(args.extractor)
    which = list(range(args.clips or len(held)))
    truth = held.poses(which)
    with torch.no_grad():
        real = judge.of_motion(torch.from_numpy(truth)).numpy()
        conditions = torch.cat([judge.of_condition(*held.given(judge.standard, which[a:a + 64])) for a in range(0, len(which), 64)]).numpy()
    times, rows = [reaction_time(truth[k], held.clips[i]) for k, i in enumerate(which)], {}

    def add(name, x):
        rows[name] = row(judge, held, which, x, real, conditions, times)
        print(name, json.dumps(rows[name]), flush=True)
        with open(args.out, "w") as f:
            json.dump(rows, f, indent=1)

    add("real", truth)
    add("random", data.poses(np.random.default_rng(1).integers(0, 2 * len(data), len(which)).tolist()))
    for name, _, path in (m.partition("=") for m in args.motion):
        add(name, np.load(path)[which])
    net, state = train.load(args.net)
    add("nearest neighbour", nearest(data, held, which, net))

    def answers(net, state, steps):
        with mixed("cpu"):
            return diffusion.motions(net, held, which, steps, genre=None if state["genre"] else nets.UNKNOWN)

    for steps in map(int, args.steps.split(",")):
        add(f"model, {steps} steps", answers(net, state, steps))
    for name, _, path in (a.partition("=") for a in args.also):
        add(name, answers(*train.load(path), int(args.steps.split(",")[0])))


if __name__ == "__main__":
    main()
