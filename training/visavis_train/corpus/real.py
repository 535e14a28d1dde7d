"""Real takes as clips of their own: the two-person dances (both roles, mirrored) and the walks."""
import os

import numpy as np

from ..motion import rig
from ..motion.contacts import lock_feet
from ..motion.retarget import load_take
from .signals import FPS, smooth_noise

# Takes by split; a take, and for walks and speech a person, is in one split only.
TWO_PERSON = {"train": ["01", "02", "03", "04", "05", "06", "07", "09", "10"], "val": ["11", "12"], "test": ["13", "14"]}
SIGNALS = {"train": ["basketball_signal_1", "basketball_signal_2", "basketball_signal_3", "basketball_signal_4", "directing_traffic_4"],
           "val": ["basketball_signal_5"], "test": ["directing_traffic_1"]}
WALK_TEST, WALK_VAL, WALK_SKIP = {"16", "49"}, {"12", "32"}, {"03"}
# Dips to the floor, frames of the files at 60 Hz (README of the data)
LEAVE_OUT = {"60_01": [(701, 914)], "60_02": [(1294, 1383)], "60_11": [(1691, 1745)], "61_11": [(1678, 1757)]}
SPEED_LIMIT = 9.0  # m/s of any joint; frames above it are capture errors and split a take


def walk_split(name):
    subject = name.split("_")[0]
    return "test" if subject in WALK_TEST else "val" if subject in WALK_VAL else "train"


def signal_takes(data, split, skeleton):
    folder = os.path.join(data, "motion", "cmu_signals")
    return [load_take(os.path.join(folder, n + ".txt"), n, skeleton) for n in SIGNALS[split]]


def _pieces(bad, least):
    """Runs of good frames at least `least` long: [(start, end)]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[1], bad.astype(int), [1]])))
    return [(a, b) for a, b in edges.reshape(-1, 2) if b - a >= least]


def two_person(data, split, least=6.0):
    """Yields (name, positions, rotations, other head) of good stretches, both roles, mirrored too."""
    folder = os.path.join(data, "motion", "cmu_two_person")
    for nn in TWO_PERSON[split]:
        takes = [load_take(os.path.join(folder, f"{s}_{nn}.bvh"), f"{s}_{nn}") for s in ("60", "61")]
        n = min(len(t.positions) for t in takes)
        bad = np.zeros(n, bool)
        for t in takes:
            for a, b in LEAVE_OUT.get(t.name, []):
                bad[a // 2 - 3: b // 2 + 3] = True
            v = np.linalg.norm(np.diff(t.positions[:n], axis=0), axis=-1).max(1) * FPS
            for i in np.flatnonzero(v > SPEED_LIMIT):
                bad[max(0, i - 1): i + 3] = True
        heads = [t.positions[:, rig.INDEX["head"]] + t.rotations[:, rig.INDEX["head"]] @ rig.EYES for t in takes]
        for a, b in _pieces(bad, int(least * FPS)):
            for k in (0, 1):
                p, r = lock_feet(takes[k].positions[a:b], takes[k].rotations[a:b])
                u = heads[1 - k][a:b]
                yield f"{takes[k].name}_{a}", p, r, u
                mp, mr = rig.mirror(p, r)
                yield f"{takes[k].name}_{a}_mirror", mp, mr, u * [-1, 1, 1]


def head_paths(data, split):
    """Head paths [n, 3] of the real pairs, for simulated users of the same split."""
    return [u for name, _, _, u in two_person(data, split, 4.0)]


def walks(data, split, rng):
    """Yields (name, positions, rotations, user) of the walks; the user stands ahead or goes before the walker."""
    folder = os.path.join(data, "motion", "cmu_walk")
    for f in sorted(os.listdir(folder)):
        name = f[:-4]
        if not f.endswith(".bvh") or walk_split(name) != split or name.split("_")[0] in WALK_SKIP:
            continue
        take = load_take(os.path.join(folder, f), name)
        bad = np.concatenate([[False], np.linalg.norm(np.diff(take.positions, axis=0), axis=-1).max(1) * FPS > SPEED_LIMIT])
        whole = _pieces(bad, 45)
        for (a, b), mirrored in [(w, m) for w in whole for m in (False, True)]:
            p, r = lock_feet(take.positions[a:b], take.rotations[a:b])
            if mirrored:
                p, r = rig.mirror(p, r)
            n = len(p)
            way = p[-1, 0] - p[0, 0]
            way = way * [1, 0, 1]
            way = rig.unit(way) if np.linalg.norm(way) > 0.5 else np.array([0, 0, 1.0])
            side = np.array([way[2], 0, -way[0]])
            ahead = way * rng.uniform(1.2, 2.5) + side * rng.normal(0, 0.3)
            path = np.repeat(p[-1:, 0], n, 0) if rng.random() < 0.6 else p[:, 0]
            u = path * [1, 0, 1] + ahead + [0, rng.uniform(1.45, 1.8), 0]
            u = u + np.stack([smooth_noise(rng, n, 2.0, 0.015) for _ in range(3)], 1)
            yield f"{name}_{a}" + ("_mirror" if mirrored else ""), p, r, u
