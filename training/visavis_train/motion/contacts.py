"""Foot locking for retargeted takes: toes that stand still in the source are put exactly still, legs follow by IK.

Contacts are found by height and speed of the toes (the usual heuristic, e.g. Holden et al. 2020, Learned Motion Matching)."""
import numpy as np

from . import rig
from .rig import INDEX, OFFSETS

LEGS = (("leftUpperLeg", "leftLowerLeg", "leftFoot", "leftToes"), ("rightUpperLeg", "rightLowerLeg", "rightFoot", "rightToes"))
THIGH, SHANK = 0.410, 0.395


def two_bone(root, target, pole, a, b):
    """Analytic two-bone IK: unit directions of the upper and lower bone [T, 3] and the bend axis (pole x line)."""
    w = target - root
    d = np.linalg.norm(w, axis=-1, keepdims=True)
    w = w / np.maximum(d, 1e-9)
    d = np.clip(d, abs(a - b) + 0.02, (a + b) * 0.9995)
    e = rig.unit(pole - np.sum(pole * w, -1, keepdims=True) * w)
    ca = np.clip((a * a + d * d - b * b) / (2 * a * d), -1, 1)
    up = w * ca + e * np.sqrt(1 - ca * ca)
    return up, rig.unit(w * d - up * a), np.cross(e, w)


def _smooth(x, sigma):
    r = int(4 * sigma)
    k = np.exp(-0.5 * (np.arange(-r, r + 1) / sigma) ** 2)
    pad = np.pad(x, ((r, r),) + ((0, 0),) * (x.ndim - 1), mode="edge").reshape(len(x) + 2 * r, -1)
    return np.stack([np.convolve(pad[:, c], k / k.sum(), "valid") for c in range(pad.shape[1])], 1).reshape(x.shape)


def contacts(toe, height=0.065, speed=0.55, least=3):
    """Runs of contact [(start, end)] of one toe path [T, 3]."""
    v = np.linalg.norm(np.gradient(_smooth(toe, 0.7), axis=0)[:, [0, 2]], axis=1) * rig.FPS
    on = (v < speed) & (toe[:, 1] < toe[:, 1].min() + height + 0.02) & (toe[:, 1] < height + rig.TOE_HEIGHT)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], on.astype(int), [0]])))
    return [(a, b) for a, b in edges.reshape(-1, 2) if b - a >= least]


def lock_feet(positions, rotations):
    """Returns (positions, rotations) with planted toes fixed on the floor. Shapes [T, 22, 3], [T, 22, 3, 3]."""
    t = len(positions)
    g = rotations.copy()
    toe_off = OFFSETS[INDEX["leftToes"]]
    ankles, hips = [], positions[:, 0].copy()
    for leg in LEGS:
        toe = positions[:, INDEX[leg[3]]]
        runs = contacts(toe)
        xs, delta = [], []
        for a, b in runs:
            # a long stance that creeps is cut where it has crept 5 cm, so that the lock follows pivots and shuffles
            i = a
            while i < b:
                far = np.flatnonzero(np.linalg.norm(toe[i:b] - toe[i], axis=1) > 0.06)
                j = i + (far[0] if len(far) and far[0] >= 3 else b - i)
                spot = np.append(toe[i:j, [0, 2]].mean(0), 0)[[0, 2, 1]]
                spot[1] = rig.TOE_HEIGHT
                end = j if j == b else j - min(3, (j - i) // 2)
                xs.append(np.arange(i, end)), delta.append(spot - toe[i:end])
                i = j
        if xs:
            xs, delta = np.concatenate(xs), np.concatenate(delta)
            move = np.stack([np.interp(np.arange(t), xs, delta[:, c]) for c in range(3)], 1)
        else:
            move = np.zeros((t, 3))
        new = toe + move
        new[:, 1] = np.maximum(new[:, 1], rig.TOE_HEIGHT)
        ankle = new - g[:, INDEX[leg[2]]] @ toe_off
        ankle[:, 1] = np.maximum(ankle[:, 1], rig.ANKLE_HEIGHT - 0.012)
        new_off = new - ankle                            # keep the foot's own direction where the ankle was lifted
        g[:, INDEX[leg[2]]] = rig.between(rig.unit(g[:, INDEX[leg[2]]] @ toe_off), rig.unit(new_off)) @ g[:, INDEX[leg[2]]]
        ankles.append(new - g[:, INDEX[leg[2]]] @ toe_off)
    drop = np.zeros(t)
    for leg, ankle in zip(LEGS, ankles):
        d = ankle - (hips + g[:, 0] @ OFFSETS[INDEX[leg[0]]])
        reach = np.sqrt(np.maximum(0.8045 ** 2 - d[:, 0] ** 2 - d[:, 2] ** 2, 0.05))
        drop = np.maximum(drop, -d[:, 1] - reach)        # how far the hips must sink for this leg to reach
    win = np.lib.stride_tricks.sliding_window_view(np.pad(drop, 6, mode="edge"), 13).max(1)
    hips[:, 1] -= _smooth(np.maximum(win, 0), 1.5)
    for leg, ankle in zip(LEGS, ankles):
        up, lo = INDEX[leg[0]], INDEX[leg[1]]
        start = hips + g[:, 0] @ OFFSETS[up]
        pole = g[:, up, :, 2]                            # knees bend towards the thigh's +Z
        a, b, n = two_bone(start, ankle, pole, THIGH, SHANK)
        x = rig.unit(n)
        for j, y in ((up, -a), (lo, -b)):
            g[:, j] = np.stack([x, y, np.cross(x, y)], -1)
    return rig.fk_global(hips, g), g
