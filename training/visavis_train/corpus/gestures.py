"""Wrist paths of the arms: rest poses, beat gestures in phases, shapes parametric and from the real arm-signal takes.

Phases preparation, stroke, hold, retraction (Kendon 1980; McNeill 1992); strokes fall on or just before stressed
syllables (Loehr 2012); amplitude follows loudness. Positions are relative to the shoulder (upper-arm joint), in the
upper chest's frame, written for the *left* arm (outward = +X); the right arm mirrors X.
"""
from dataclasses import dataclass

import numpy as np

from ..motion import rig
from .signals import FPS, gaussian, keyed, minjerk, smooth_noise

# name: (wrist relative to the shoulder [m], elbow swivel outwards [rad], palm twist [rad], both hands?)
RESTS = {
    "hang": ((0.07, -0.490, 0.06), 0.25, 0.15, False),
    "hang_wide": ((0.12, -0.475, 0.08), 0.40, 0.3, False),
    "clasp": ((-0.135, -0.350, 0.235), 0.75, 0.1, True),
    "belly": ((-0.09, -0.270, 0.265), 0.80, 0.25, True),
    "hip": ((0.045, -0.375, 0.06), 1.15, 0.5, False),
}
SWIVEL_GESTURE = 0.5


@dataclass
class Arms:
    """Per side (0 left, 1 right): wrist [2, T, 3] in the mirrored shoulder frame, elbow swivel [2, T], twist [2, T]; the
    gesture mask [2, T]."""
    wrist: np.ndarray
    swivel: np.ndarray
    twist: np.ndarray
    active: np.ndarray


def real_shapes(takes):
    """From retargeted arm-signal takes: stroke positions [N, 3] and motifs [M, 36, 3] (-0.5..+0.7 s about speed peaks).

    Both are wrist positions relative to the shoulder in the upper chest's frame, mirrored to the left arm."""
    spots, motifs = [], []
    ch = rig.INDEX["upperChest"]
    for take in takes:
        for side, sign in (("left", 1), ("right", -1)):
            w, s = rig.INDEX[side + "Hand"], rig.INDEX[side + "UpperArm"]
            rel = np.einsum("tba,tb->ta", take.rotations[:, ch], take.positions[:, w] - take.positions[:, s])
            rel = rel * [sign, 1, 1]
            v = np.concatenate([[0], np.linalg.norm(np.diff(gaussian(rel, 1), axis=0), axis=1) * FPS])
            front = (rel[:, 2] > 0.10) & (rel[:, 1] > -0.42)
            still = front & (v < 0.25)
            spots.append(rel[still][::6])
            for p in np.flatnonzero((v[1:-1] > v[:-2]) & (v[1:-1] >= v[2:]) & (v[1:-1] > 0.7) & (v[1:-1] < 4.0)) + 1:
                if p >= 15 and p + 21 < len(rel) and v[p - 15: p + 21].max() < 4.5:
                    seg = gaussian(rel[p - 15: p + 21], 0.8)
                    line = np.linspace(0, 1, 36)[:, None]
                    motifs.append(seg - seg[0] * (1 - line) - seg[-1] * line)
    return np.concatenate(spots), (np.stack(motifs) if motifs else np.zeros((0, 36, 3)))


def _draw_spot(rng, spots, size):
    """Where a stroke ends: gesture space in front of the trunk (McNeill's centre and periphery)."""
    if spots is not None and len(spots) and rng.random() < 0.5:
        s = spots[rng.integers(len(spots))]
        center = np.array([0.03, -0.26, 0.30])
        s = center + (s - center) * (0.35 + 0.45 * size)
    else:
        s = np.array([rng.normal(0.05, 0.08), rng.normal(-0.25, 0.07) + 0.10 * (size - 0.6), rng.normal(0.31, 0.05)])
        s[0] += 0.10 * size * rng.random()
    return limit(s)


def limit(p):
    """Keeps wrists [..., 3] within reach and in front of the trunk."""
    p = np.array(p, float)
    p[..., 0] = np.maximum(p[..., 0], -0.15)
    p[..., 2] = np.maximum(p[..., 2], 0.03 + 0.16 * np.clip((0.08 - p[..., 0]) / 0.11, 0, 1) * np.clip((p[..., 1] + 0.49) / 0.06, 0, 1))
    p[..., 1] = np.minimum(p[..., 1], 0.02 + 0.12 * np.tanh(np.maximum(p[..., 1], 0.0)))
    r = np.linalg.norm(p, axis=-1, keepdims=True)
    return p * np.minimum(1.0, 0.505 / np.maximum(r, 1e-6)) * np.maximum(1.0, 0.20 / np.maximum(r, 1e-6))


def _rest_plan(rng, frames):
    """Sequence of (start frame, pose name of left, of right)."""
    style = rng.choice(["hang", "hang_wide", "clasp", "belly", "mixed"], p=[0.4, 0.15, 0.15, 0.12, 0.18])
    out, t = [], 0
    while t < frames:
        if style == "mixed" or rng.random() < 0.2:
            name = rng.choice(list(RESTS), p=[0.4, 0.2, 0.15, 0.1, 0.15])
        else:
            name = style
        pair = [name, name]
        if name == "hip" and rng.random() < 0.6:
            pair[rng.integers(2)] = "hang"
        out.append((t, pair))
        t += int(FPS * rng.uniform(8, 30))
    return out


def plan(rng, frames, peaks, strength, phrases, spots, motifs, liveliness, walk_speed):
    """Arms for a clip. `peaks`, `strength`: prosodic peaks of the agent's voice; `liveliness` 0..1; walk_speed [T]."""
    wrist, swivel, twist = np.zeros((2, frames, 3)), np.zeros((2, frames)), np.zeros((2, frames))
    active = np.zeros((2, frames))
    rests = _rest_plan(rng, frames)
    jitter = {n: [rng.normal(0, 0.012, 3) for _ in range(2)] for n in RESTS}
    units = _units(rng, peaks, strength, liveliness, spots, motifs)
    for side in (0, 1):
        times, w, po, tw = [], [], [], []

        def key(t, pos, pl, ang):
            if times and t - times[-1] < 4:            # closer keys would jerk
                return
            times.append(t), w.append(np.asarray(pos, float)), po.append(float(pl)), tw.append(float(ang))

        def rest_at(t):
            name = [p for s, p in rests if s <= max(t, 0)][-1][side]
            pos, pl, ang, _ = RESTS[name]
            return np.array(pos) + jitter[name][side], pl, ang

        changes = [s for s, _ in rests][1:]
        key(0, *rest_at(0))
        mot = np.zeros((frames, 3))
        for unit in units:
            if side not in unit["hands"]:
                continue
            first = unit["strokes"][0][0]
            prep = first - int(FPS * 0.2) - int(FPS * rng.uniform(0.35, 0.6))
            if prep <= times[-1] + 3:
                prep = times[-1] + 1
                if first - int(FPS * 0.2) - prep < 6:
                    continue
            for c in [c for c in changes if times[-1] < c < prep - 30]:
                key(c, *rest_at(c - 1)), key(c + int(FPS * 0.9), *rest_at(c + 1))
            if times[-1] < prep:
                key(prep, w[-1], po[-1], tw[-1])
            plan_ = unit["plans"][0 if unit["sym"] else side]
            for (t, s), (spot, raise_, ang, pl, before, after, motif) in zip(unit["strokes"], plan_):
                spot = limit(spot + rng.normal(0, 0.008, 3))
                key(t - before, limit(spot + raise_), pl, ang - 0.15)
                key(t + 1, spot, pl, ang + 0.15)
                key(t + 1 + after, limit(spot + 0.18 * raise_), pl, ang)
                if motif is not None:
                    a, b = max(0, t - 15), min(frames, t + 21)
                    mot[a:b] += motif[a - (t - 15): 36 - (t + 21 - b)]
            end = times[-1] + int(FPS * rng.uniform(0.1, 0.7))
            key(end, w[-1] + rng.normal(0, 0.008, 3), po[-1], tw[-1])
            back = end + int(FPS * rng.uniform(0.55, 0.95))
            key(back, *rest_at(back))
            active[side, max(0, prep): min(frames, back)] = 1
        for c in [c for c in changes if c > times[-1]]:
            key(c, *rest_at(c - 1)), key(c + int(FPS * 0.9), *rest_at(c + 1))
        p = keyed(frames, times, np.array(w)) + mot
        a = gaussian(active[side], 6)
        live = 0.004 + 0.010 * a                     # small drift, more in gesture than at rest
        p += np.stack([smooth_noise(rng, frames, pr, 1.0) * live for pr in (0.9, 0.8, 1.0)], 1)
        wrist[side] = gaussian(limit(p), 1.0)
        swivel[side] = gaussian(keyed(frames, times, np.array(po)), 1.5)
        twist[side] = gaussian(keyed(frames, times, np.array(tw)), 1.5) + smooth_noise(rng, frames, 1.2, 0.03)
    return Arms(wrist, swivel, twist, active)


def _stroke_plan(rng, strokes, size, spots, motifs):
    """Per stroke: apex, raise of the preparation, palm angle, elbow swivel, frames before and after, motif or None."""
    out, spot = [], _draw_spot(rng, spots, size)
    for _, s in strokes:
        reach = size * (0.55 + 0.6 * min(s, 1.2))
        if rng.random() < 0.6:
            spot = limit(0.5 * spot + 0.5 * _draw_spot(rng, spots, size))
        raise_ = np.array([rng.normal(-0.015, 0.025), rng.uniform(0.08, 0.20), rng.uniform(-0.06, 0.01)]) * reach
        motif = None
        if len(motifs) and rng.random() < 0.4:
            motif = motifs[rng.integers(len(motifs))] * (0.2 + 0.2 * reach) * [1, 0.8, 0.8]
        out.append((spot, raise_, rng.normal(-0.35, 0.45), SWIVEL_GESTURE + rng.normal(0, 0.15),
                    int(round(FPS * rng.uniform(0.19, 0.27))), int(FPS * rng.uniform(0.15, 0.25)), motif))
    return out


def _units(rng, peaks, strength, liveliness, spots, motifs):
    """Groups stressed peaks into gesture units of 1-6 strokes."""
    units, i = [], 0
    while i < len(peaks):
        if rng.random() > 0.45 + 0.6 * liveliness:
            i += int(rng.integers(1, 4))
            continue
        strokes, n = [(peaks[i], strength[i])], int(rng.integers(1, 6))
        i += 1
        while i < len(peaks) and len(strokes) < n and peaks[i] - strokes[-1][0] < 1.5 * FPS:
            if peaks[i] - strokes[-1][0] >= 0.5 * FPS and rng.random() < 0.85:
                strokes.append((peaks[i], strength[i]))
            i += 1
        r = rng.random()
        hands = (0, 1) if r < 0.5 else (1,) if r < 0.8 else (0,)
        size = np.clip(rng.normal(0.5 + 0.65 * liveliness, 0.2), 0.25, 1.3)
        units.append({"strokes": strokes, "hands": hands, "sym": len(hands) == 2 and rng.random() < 0.6,
                      "plans": [_stroke_plan(rng, strokes, size, spots, motifs) for _ in (0, 1)]})
    return units
