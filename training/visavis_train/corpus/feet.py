"""Footstep planner: which foot stands where, when it swings, and how the pelvis follows.

Feet are locked exactly while planted. Swing duration, step height and toe-off pitch follow the ranges of the
retargeted walks of `cmu_walk` (swing 0.35-0.5 s, toe clearance 3-7 cm, heel-off 20-35 degrees in long steps).
"""
from dataclasses import dataclass

import numpy as np

from ..motion import rig
from ..motion.rig import wrap
from .signals import FPS, gaussian, minjerk
from .swings import PITCHES

HALF_WIDTH = 0.095          # lateral offset of a foot from the body's mid line [m]
TOE = rig.OFFSETS[rig.INDEX["leftToes"]]  # ankle -> toes at rest


@dataclass
class Feet:
    """Per frame and foot (0 left, 1 right): toe position [T, 2, 3], yaw [T, 2], pitch [T, 2] (heel up > 0), swing phase
    [T, 2] (0 planted, else 0..1), load on the left foot [T] 0..1, and the list of steps (foot, start, end)."""
    toe: np.ndarray
    yaw: np.ndarray
    pitch: np.ndarray
    swing: np.ndarray
    load: np.ndarray
    steps: list

    def ankles(self):
        """Foot rotations [T, 2, 3, 3] and ankle positions [T, 2, 3]."""
        r = rig.axis_mat("y", self.yaw) @ rig.axis_mat("x", self.pitch)
        return r, self.toe - r @ TOE


def _spot(root, yaw, foot, toe_out, spread):
    """Toe position (x, z) and yaw of a foot standing comfortably under a root."""
    sign = 1 if foot == 0 else -1
    fy = yaw + sign * toe_out
    side = np.array([np.cos(yaw), -np.sin(yaw)]) * sign * HALF_WIDTH * spread
    ahead = np.array([np.sin(fy), np.cos(fy)]) * (TOE[2] - 0.045)
    return root + side + ahead, fy


def plan(rng, root, yaw, library=None):
    """Footsteps for a root path: root [T, 2], yaw [T] -> Feet. `library`: real swings (swings.Swings), else smooth curves."""
    t_end = len(root)
    toe_out, spread = rng.uniform(0.06, 0.22), rng.uniform(0.95, 1.35)
    lift = rng.uniform(0.05, 0.08)
    vel = gaussian(np.gradient(root, axis=0) * FPS, 3)
    speed = np.hypot(vel[:, 0], vel[:, 1])
    rate = np.abs(gaussian(np.gradient(np.unwrap(yaw)) * FPS, 3))
    pos, fyaw = [None, None], [0.0, 0.0]
    for f in (0, 1):
        pos[f], fyaw[f] = _spot(root[0], yaw[0], f, toe_out, spread)
    toe = np.zeros((t_end, 2, 3))
    oy, swing = np.zeros((t_end, 2)), np.zeros((t_end, 2))
    steps, likes, like, busy, last, last_end, uneasy = [], [], None, None, 1, -30, 0
    for t in range(t_end):
        if busy is None:
            errs = []
            for f in (0, 1):
                s, sy = _spot(root[t], yaw[t], f, toe_out, spread)
                errs.append((np.hypot(*(s - pos[f])), abs(wrap(sy - fyaw[f]))))
            cost = [e + 0.28 * a for e, a in errs]
            going = max(speed[min(t + 6, t_end - 1)], speed[t]) > 0.13 or max(rate[min(t + 5, t_end - 1)], rate[t]) > 0.35
            uneasy = uneasy + 1 if max(cost) > 0.055 else 0
            since = t - last_end
            f = 1 - last
            if going:
                if cost[1 - f] > cost[f] + 0.22 and since > 2:
                    f = 1 - f
                start = cost[f] > 0.05 and since >= (1 if speed[t] > 0.8 or max(cost) > 0.35 else 3 if speed[t] > 0.4 or max(cost) > 0.2 else 5)
            else:
                f = int(np.argmax(cost))
                start = (cost[f] > 0.13 and since > 4) or (uneasy > 20 and since > 8)
            if start:
                dur = int(round(FPS * (0.47 - 0.07 * min(speed[t], 1.3) + rng.normal(0, 0.02))))
                if max(cost) > 0.25:
                    dur -= 2
                dur = int(np.clip(dur, 9, 15))
                land = min(t + dur + int(0.5 * dur * min(1, speed[t] / 0.5)), t_end - 1)
                goal, gy = _spot(root[land], yaw[land], f, toe_out, spread)
                dur = max(dur, min(14, int(np.ceil(10 * np.hypot(*(goal - pos[f]))))))  # toe peak speed 1.7 L / T about 5 m/s
                gy = fyaw[1 - f] + np.clip(wrap(gy - fyaw[1 - f]), -1.05, 1.05)
                goal = _keep_clear(goal, pos[1 - f], fyaw[1 - f], f)
                busy = (f, t, t + dur, pos[f].copy(), fyaw[f], goal, fyaw[f] + wrap(gy - fyaw[f]))
                if library is not None:
                    like = _like(rng, library, busy)
                    curve = library.curves(like, np.arange(dur) / dur)
                uneasy = 0
        for f in (0, 1):
            toe[t, f, [0, 2]] = pos[f]
            oy[t, f] = fyaw[f]
        if busy is not None:
            f, a, b, p0, y0, p1, y1 = busy
            u = (t - a) / (b - a)
            c = np.clip((u - 0.05) / 0.9, 0, 1)
            s = turned = 0.5 * (minjerk(c) + c * c * (3 - 2 * c))
            aside = 0.0
            if like is not None:
                s, aside, _, turned = curve[t - a]
            left = np.array([np.cos(y1), -np.sin(y1)]) * (1 if f == 0 else -1)
            out = _bulge(p0, p1, pos[1 - f])
            toe[t, f, [0, 2]] = p0 + (p1 - p0) * s + out * np.sin(np.pi * s) + left * max(aside, -0.01)
            oy[t, f] = y0 + (y1 - y0) * turned
            swing[t, f] = max(u, 1e-3)
            if t + 1 >= b:
                pos[f], fyaw[f] = p1, y1
                steps.append((f, a, b, float(np.hypot(*(p1 - p0))), float((p1 - p0) @ [np.sin(y1), np.cos(y1)])))
                likes.append(like)
                last, last_end, busy = f, t, None
    pitch = np.zeros((t_end, 2))
    toe[..., 1] = rig.TOE_HEIGHT
    for (f, a, b, length, ahead), like in zip(steps, likes):
        if like is not None:
            _lift(library, like, toe[:, f, 1], pitch[:, f], a, b, length)
            continue
        k = np.clip(ahead / 0.6, -0.35, 1.0)
        n = b - a
        u = np.arange(n) / n
        height_gain = lift * (0.55 + 0.6 * min(length / 0.5, 1.2))
        toe[a:b, f, 1] += height_gain * np.sin(np.pi * u ** 0.85) ** 1.2
        off = 0.10 + 0.42 * max(k, 0)                     # pitch at toe-off
        pre = max(2, int(5 * max(k, 0.2)))                # frames of heel-off before the foot leaves
        a0 = max(0, a - pre)
        pitch[a0:a, f] = np.maximum(pitch[a0:a, f], off * minjerk((np.arange(a0, a) - a0 + 1) / (pre + 2)))
        start = pitch[a - 1, f] if a > a0 else 0.0
        mid = off * 1.1
        strike = -0.22 * max(k, 0)
        pitch[a:b, f] = np.where(u < 0.3, start + (mid - start) * minjerk(u / 0.3),
                                 np.where(u < 0.8, mid + (strike - mid) * minjerk((u - 0.3) / 0.5), strike * (1 - minjerk((u - 0.8) / 0.2))))
    load = np.full(t_end, 0.5)
    load[swing[:, 0] > 0] = 0.0
    load[swing[:, 1] > 0] = 1.0
    return Feet(toe, oy, pitch, swing, load, steps)


def _like(rng, library, step):
    """Index of a real swing that goes about as far, turns about as much and takes about as long as a step."""
    f, a, b, p0, y0, p1, y1 = step
    out = 1 if f == 0 else -1
    fwd, left = np.array([np.sin(y1), np.cos(y1)]), np.array([np.cos(y1), -np.sin(y1)])
    return library.nearest(rng, np.array([(p1 - p0) @ fwd, (p1 - p0) @ left * out, (y1 - y0) * out, (b - a) / FPS]))


def _lift(library, like, height, pitch, a, b, length):
    """Writes height above the floor and pitch of a real swing into one foot's tracks [T], frames a..b and around."""
    n, t_end = b - a, len(height)
    real = np.hypot(*library.what[like, :2])
    gain = np.clip(np.sqrt((length + 0.05) / (real + 0.05)), 0.5, 1.3)         # a shorter step is a lower one
    height[a:b] += gain * np.maximum(library.curves(like, np.arange(n) / n)[:, 2], 0)
    lo, hi = max(0, int(np.ceil(a + PITCHES[0] * n))), min(t_end, int(a + PITCHES[-1] * n))
    u = (np.arange(lo, hi) - a) / n
    tilt = gain * library.tilt(like, u)
    tilt = np.where(tilt < 0, tilt * minjerk((1 - u) / 0.25), tilt)                # a lifted toe is down by the landing
    on = (np.arange(lo, hi) < a) | (np.arange(lo, hi) >= b)
    pitch[lo:hi] += np.where(on, np.maximum(tilt, 0), np.clip(tilt, -0.3, 0.9))   # the toe stays down while the foot stands


def _keep_clear(goal, other, other_yaw, foot):
    """Keeps a landing spot on its own side of the standing foot, at least 14 cm across."""
    side = np.array([np.cos(other_yaw), -np.sin(other_yaw)]) * (1 if foot == 0 else -1)
    across = (goal - other) @ side
    return goal + side * max(0.0, 0.14 - across) if across < 0.14 else goal


def _bulge(p0, p1, other):
    """Sideways detour of a swing that would pass within 13 cm of the standing foot."""
    d = p1 - p0
    n2 = d @ d
    if n2 < 1e-4:
        return np.zeros(2)
    u = np.clip((other - p0) @ d / n2, 0, 1)
    away = p0 + u * d - other
    gap = np.hypot(*away)
    if u <= 0.05 or u >= 0.95 or gap >= 0.13:
        return np.zeros(2)
    n = np.array([d[1], -d[0]]) / np.sqrt(n2)
    return n * (0.13 - gap) * (1 if n @ away >= 0 else -1)
