"""Real takes as clips of their own: the two-person dances (both roles, mirrored), the walks and people at rest."""
import os

import numpy as np

from ..motion import rig
from ..motion.contacts import lock_feet
from ..motion.retarget import load_take
from . import rest, swings
from .signals import FPS, gaussian, minjerk, smooth_noise

# Takes by split; a take, and for walks and speech a person, is in one split only.
TWO_PERSON = {"train": ["01", "02", "03", "04", "05", "06", "07", "09", "10"], "val": ["11", "12"], "test": ["13", "14"]}
SIGNALS = {"train": ["basketball_signal_1", "basketball_signal_2", "basketball_signal_3", "basketball_signal_4", "directing_traffic_4"],
           "val": ["basketball_signal_5"], "test": ["directing_traffic_1"]}
WALK_TEST, WALK_VAL, WALK_SKIP = {"16", "49"}, {"12", "32"}, {"03"}
# Dips to the floor, frames of the files at 60 Hz (README of the data)
LEAVE_OUT = {"60_01": [(701, 914)], "60_02": [(1294, 1383)], "60_11": [(1691, 1745)], "61_11": [(1678, 1757)]}
SPEED_LIMIT, ACCEL_LIMIT = 9.0, 170.0  # m/s, m/s2 of any joint; frames above are capture errors and split a take


def walk_split(name):
    subject = name.split("_")[0]
    return "test" if subject in WALK_TEST else "val" if subject in WALK_VAL else "train"


def capture_errors(positions):
    """Frames [T] bool around which a joint moves faster than people do."""
    v = np.linalg.norm(np.diff(positions, axis=0), axis=-1).max(1) * FPS
    a = np.linalg.norm(np.diff(positions, 2, axis=0), axis=-1).max(1) * FPS ** 2
    bad = np.zeros(len(positions), bool)
    for i in np.concatenate([np.flatnonzero(v > SPEED_LIMIT), np.flatnonzero(a > ACCEL_LIMIT)]):
        bad[max(0, i - 1): i + 3] = True
    return bad


def signal_takes(data, split, skeleton):
    folder = os.path.join(data, "motion", "cmu_signals")
    return [load_take(os.path.join(folder, n + ".txt"), n, skeleton) for n in SIGNALS[split]]


def _pieces(bad, least):
    """Runs of good frames at least `least` long: [(start, end)]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[1], bad.astype(int), [1]])))
    return [(a, b) for a, b in edges.reshape(-1, 2) if b - a >= least]


def two_person(data, split, least=6.0):
    """Yields (name, positions, rotations, other head, its rotations) of good stretches, both roles, mirrored too."""
    folder = os.path.join(data, "motion", "cmu_two_person")
    for nn in TWO_PERSON[split]:
        takes = [load_take(os.path.join(folder, f"{s}_{nn}.bvh"), f"{s}_{nn}") for s in ("60", "61")]
        n = min(len(t.positions) for t in takes)
        bad = np.zeros(n, bool)
        for t in takes:
            for a, b in LEAVE_OUT.get(t.name, []):
                bad[a // 2 - 3: b // 2 + 3] = True
            bad |= capture_errors(t.positions[:n])
        heads = [t.positions[:, rig.INDEX["head"]] + t.rotations[:, rig.INDEX["head"]] @ rig.EYES for t in takes]
        for a, b in _pieces(bad, int(least * FPS)):
            for k in (0, 1):
                p, r = lock_feet(takes[k].positions[a:b], takes[k].rotations[a:b])
                u, seen = heads[1 - k][a:b], takes[1 - k].rotations[a:b, rig.INDEX["head"]]
                yield f"{takes[k].name}_{a}", p, r, u, seen
                mp, mr = rig.mirror(p, r)
                side = np.array([-1.0, 1.0, 1.0])
                yield f"{takes[k].name}_{a}_mirror", mp, mr, u * side, seen * side[:, None] * side


def head_paths(data, split):
    """Head paths [n, 3] of the real pairs, for simulated users of the same split."""
    return [u for _, _, _, u, _ in two_person(data, split, 4.0)]


# Walks, turns, side steps and stops of one actress: train only
ACCAD_WALKS = ("B01_StandToWalk", "B02_WalkToStand", "B02_WalkToStandT2", "B03_Walk1", "B04_StandToWalkBack", "B05_WalkBackwards",
               "B06_WalkBackwardsToStand", "B07_WalkBackwardsTurnForwards", "B08_WalkBackwardsStopForwards", "B09_WalkTurnLeft90",
               "B10_WalkTurnLeft45", "B11_WalkTurnLeft135", "B12_WalkTurnRight90", "B13_WalkTurnRight45", "B14_WalkTurnRight135",
               "B15_WalkTurnAround180", "B16_WalkTurnChangeDirection", "B22_SideStepLeft", "B23_SideStepRight")


def accad_walks(data, split):
    """Good stretches of the actress's walks: [(name, positions, rotations)]."""
    if split != "train":
        return []
    out = []
    for name in ACCAD_WALKS:
        name = "accad_female1/Female1_" + name
        t = rest.take(data, name)
        out += [(f"{name}_{a}", t.positions[a:b], t.rotations[a:b]) for a, b in _pieces(capture_errors(t.positions), 45)]
    return out


def swing_library(data, split):
    """Swings of the walks of a split, mirrored ones too (an outward step of the left foot is one of the right)."""
    takes = [(p, r) for _, p, r in walk_takes(data, split) + accad_walks(data, split)]
    return swings.gather(takes)


def idles(data, split, rng):
    """Yields (name, positions, rotations, user): people at rest as clips of their own, mirrored too; someone stands before
    them, where they look most of the time or up to 0.6 rad aside of it."""
    names = list(rest.TAKES[split]) + (["accad_female1/Female1_D1_Urban", "accad_female1/Female1_D2_Wait"] if split == "train" else [])
    for name in names:
        t = rest.take(data, name)
        for a, b in _pieces(capture_errors(t.positions), 6 * FPS):
            p, r = rest.dressed(*lock_feet(t.positions[a:b], t.rotations[a:b]))
            for tag, (p, r) in (("", (p, r)), ("_mirror", rig.mirror(p, r))):
                n = len(p)
                look = np.median(np.unwrap(rig.yaw_of(r[:, rig.INDEX["head"]]))) + rng.uniform(-0.6, 0.6)
                away = rng.uniform(1.2, 2.4)
                u = np.tile(np.median(p[:, 0], 0) + away * np.array([np.sin(look), 0, np.cos(look)]), (n, 1))
                u[:, 1] = rng.uniform(1.45, 1.80)
                for c, amp in ((0, 0.012), (1, 0.004), (2, 0.012)):
                    u[:, c] += smooth_noise(rng, n, 1.3, amp) + smooth_noise(rng, n, 4.0, amp)
                yield f"{name.replace('/', '_')}_{a}{tag}", p, r, u


def walk_takes(data, split):
    """Good stretches of the walks of a split: [(name, positions, rotations)], mirrored ones too."""
    folder = os.path.join(data, "motion", "cmu_walk")
    out = []
    for f in sorted(os.listdir(folder)):
        name = f[:-4]
        if not f.endswith(".bvh") or walk_split(name) != split or name.split("_")[0] in WALK_SKIP:
            continue
        take = load_take(os.path.join(folder, f), name)
        bad = capture_errors(take.positions)
        for a, b in _pieces(bad, 45):
            out.append((f"{name}_{a}", take.positions[a:b], take.rotations[a:b]))
            out.append((f"{name}_{a}_mirror", *rig.mirror(take.positions[a:b], take.rotations[a:b])))
    return out


def _pose(p, r):
    """Joint positions [T, 66] in the heading frame, for matching."""
    inv = rig.axis_mat("y", -rig.yaw_of(r[:, 0]))
    return np.einsum("tab,tjb->tja", inv, p - p[:, :1] * [1, 0, 1]).reshape(len(p), -1)


def chain(parts, blend=12):
    """Joins takes [(positions, rotations)] into one: the next starts at its best matching frame of its first third,
    is laid where the last one ended, and its difference is inertialised away over `blend` frames (Bollo 2018)."""
    p, r = parts[0]
    for q, s in parts[1:]:
        n = max(2, len(q) // 3)
        here, there = _pose(p[-2:], r[-2:]), _pose(q[:n], s[:n])
        cost = np.linalg.norm(there[1:] - here[1], axis=1) + 6 * np.linalg.norm(there[1:] - there[:-1] - here[1] + here[0], axis=1)
        k = int(cost.argmin()) + 1
        turn = rig.axis_mat("y", rig.yaw_of(r[-1, 0]) - rig.yaw_of(s[k, 0]))
        q = (q[k:] - q[k, 0] * [1, 0, 1]) @ turn.T + p[-1, 0] * [1, 0, 1]
        s = turn @ s[k:]
        local, last = rig.global_to_local(s), rig.global_to_local(r[-1:])
        fade = 1 - minjerk(np.arange(len(s)) / blend)
        off = rig.mat_to_rotvec(last[0] @ np.swapaxes(local[0], -1, -2))
        local = rig.rotvec_to_mat(fade[:, None, None] * off) @ local
        hips = q[:, 0] + fade[:, None] * (p[-1, 0] - q[0, 0])
        s = rig.local_to_global(local)
        p, r = np.concatenate([p, rig.fk_global(hips, s)[1:]]), np.concatenate([r, s[1:]])
    return p, r


def walks(data, split, rng, seconds=30.0):
    """Yields (name, positions, rotations, user, sources): chained walks of about `seconds`; the user goes ahead of the walker."""
    takes = walk_takes(data, split) + accad_walks(data, split)
    order = rng.permutation(len(takes)).tolist()
    while order:
        parts = []
        while order and sum(len(p) for _, p, _ in parts) < seconds * FPS:
            parts.append(takes[order.pop()])
        p, r = chain([(p, r) for _, p, r in parts])
        p, r = lock_feet(p, r)
        n = len(p)
        path = gaussian(p[:, 0], 15)
        fwd = gaussian(r[:, 0, :, 2] * [1, 0, 1], 20)
        side = np.stack([fwd[:, 2], 0 * fwd[:, 0], -fwd[:, 0]], 1)
        gap = rng.uniform(1.2, 2.2) + smooth_noise(rng, n, 5, 0.25)
        u = path * [1, 0, 1] + rig.unit(fwd) * gap[:, None] + side * smooth_noise(rng, n, 4, 0.25)[:, None]
        u[:, 1] = rng.uniform(1.45, 1.8) + smooth_noise(rng, n, 0.4, 0.008)
        yield parts[0][0].replace("/", "_"), p, r, u, [name if "/" in name else "cmu_walk/" + name for name, _, _ in parts]
