"""Wrist paths of the arms: beat gestures in phases above the rest layer, shapes parametric and from the real arm-signal takes.

Phases preparation, stroke, hold, retraction (Kendon 1980; McNeill 1992); strokes fall on or just before stressed
syllables (Loehr 2012); amplitude follows loudness. Positions are relative to the shoulder (upper-arm joint), in the
upper chest's frame, written for the *left* arm (outward = +X); the right arm mirrors X.
"""
from dataclasses import dataclass

import numpy as np

from ..motion import rig
from .rest import TWIST
from .signals import FPS, gaussian, keyed, minjerk, smooth_noise

SWIVEL_GESTURE = 0.5


@dataclass
class Arms:
    """Per side (0 left, 1 right), T frames, in the mirrored shoulder frame: wrist [2, T, 3], unit direction of the elbow
    from the arm's line [2, T, 3], palm twist [2, T], share of the gesture above the rest pose 0..1 [2, T]."""
    wrist: np.ndarray
    elbow: np.ndarray
    twist: np.ndarray
    active: np.ndarray


def elbow_of(wrist, swivel):
    """Elbow directions [T, 3] of wrists [T, 3] by swivel angles [T]: behind a hanging arm, turned with the arm by the
    shortest rotation, then outwards; clear of the trunk where the arm crosses the body."""
    zero = np.zeros(len(wrist))
    out = swivel + 0.7 * np.clip((0.05 - wrist[:, 0]) / 0.15, 0, 1)
    back = np.stack([np.sin(out), zero, -np.cos(out)], 1)
    down = np.stack([zero, zero - 1, zero], 1)
    return np.einsum("tab,tb->ta", rig.between(down, rig.unit(wrist)), back)


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


def plan(rng, frames, peaks, strength, phrases, spots, motifs, liveliness, rest, busy):
    """Arms for a clip. `peaks`, `strength`: prosodic peaks of the agent's voice; `liveliness` 0..1; `rest`: the layers
    (corpus.rest.Rest) that strokes leave from, come back to and that show wherever there is no gesture; `busy` [T] bool: where they hold a gesture already."""
    wrist, elbow = rest.wrist.swapaxes(0, 1).copy(), rest.elbow.swapaxes(0, 1).copy()
    twist, active = np.full((2, frames), TWIST), np.zeros((2, frames))
    units = [u for u in _units(rng, peaks, strength, liveliness, spots, motifs)
             if not busy[max(0, u["strokes"][0][0] - FPS): u["strokes"][-1][0] + 2 * FPS].any()]
    for side in (0, 1):
        shares, holds = [0], [0.0]
        times, w, po, tw = [], [], [], []
        mot = np.zeros((frames, 3))

        def key(t, pos, pl, ang):
            if times and t - times[-1] < 4:            # closer keys would jerk
                return
            times.append(t), w.append(np.asarray(pos, float)), po.append(float(pl)), tw.append(float(ang))

        for unit in units:
            if side not in unit["hands"]:
                continue
            first = unit["strokes"][0][0]
            lead = int(FPS * rng.uniform(0.35, 0.6))
            prep = first - int(FPS * 0.2) - lead
            if prep <= shares[-1] + 3:
                prep = shares[-1] + 1
                if first - int(FPS * 0.2) - prep < 6:
                    continue
            plan_ = unit["plans"][0 if unit["sym"] else side]
            arrive = None
            for (t, s), (spot, raise_, ang, pl, before, after, motif) in zip(unit["strokes"], plan_):
                spot = limit(spot + rng.normal(0, 0.008, 3))
                key(t - before, limit(spot + raise_), pl, ang - 0.15)
                arrive = t - before if arrive is None else arrive
                key(t + 1, spot, pl, ang + 0.15)
                key(t + 1 + after, limit(spot + 0.18 * raise_), pl, ang)
                if motif is not None:
                    a, b = max(0, t - 15), min(frames, t + 21)
                    mot[a:b] += motif[a - (t - 15): 36 - (t + 21 - b)]
            end = max(times[-1] + int(FPS * rng.uniform(0.1, 0.7)), arrive + 6)
            far = np.linalg.norm(w[-1] - wrist[side, min(end, frames - 1)])
            back = end + int(FPS * (rng.uniform(0.55, 0.95) + 0.5 * max(far - 0.3, 0)))
            arrive = max(arrive, prep + 6)
            shares += [prep, arrive, end, back]
            holds += [0.0, 1.0, 1.0, 0.0]
        if not times:
            continue
        share = keyed(frames, shares, np.array(holds))
        p = keyed(frames, times, np.array(w)) + mot
        # a hand held up trembles like the resting one of the same person, a little more
        p += 1.5 * (rest.wrist[:, side] - gaussian(rest.wrist[:, side], 8.0))
        p = gaussian(limit(p), 1.0)
        turn = elbow_of(p, gaussian(keyed(frames, times, np.array(po)), 1.5))
        k = gaussian(share, 1.0)[:, None]
        wrist[side] = wrist[side] * (1 - k) + p * k
        elbow[side] = rig.unit(elbow[side] * (1 - k) + turn * k)
        twist[side] = TWIST + k[:, 0] * (gaussian(keyed(frames, times, np.array(tw)), 1.5) - TWIST + smooth_noise(rng, frames, 1.2, 0.03))
        active[side] = share
    return Arms(wrist, elbow, twist, active)


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
