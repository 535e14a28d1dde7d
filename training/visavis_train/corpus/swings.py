"""Swings of real feet in walking, turning, stepping aside and stopping: how a foot that has to go there in that time goes."""
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from ..motion import rig
from ..motion.contacts import contacts
from .signals import FPS, gaussian

PHASES = np.linspace(0, 1, 17)               # of the way and the height
PITCHES = np.linspace(-0.4, 1.3, 18)         # of the foot's pitch: heel-off begins before, foot-flat ends after the swing
SLOW = 0.15                                  # m/s: a swing begins and ends here
FEET = (("leftFoot", "leftToes"), ("rightFoot", "rightToes"))


@dataclass
class Swings:
    """N swings: `what` [N, 4] is metres ahead and outwards of where the foot points in the end, turn outwards [rad] and
    seconds; `way`, `aside`, `height`, `turn` [N, 17] the share of the distance gone, metres outwards of the straight line,
    metres above the floor and the share of the turn made; `pitch` [N, 18] rad, heel up positive."""
    what: np.ndarray
    way: np.ndarray
    aside: np.ndarray
    height: np.ndarray
    turn: np.ndarray
    pitch: np.ndarray

    def __post_init__(self):
        swing = np.stack([self.way, self.aside, self.height, self.turn], 2)
        # cubic between the samples: speeds have no corners
        self._curves = [CubicSpline(PHASES, x, bc_type="clamped") for x in swing]
        self._pitches = [CubicSpline(PITCHES, x, bc_type="natural") for x in self.pitch]

    def curves(self, i, u):
        """Way, aside, height and turn [n, 4] of swing i at phases u [n]."""
        return self._curves[i](np.clip(u, 0, 1))

    def tilt(self, i, u):
        """Pitch [n] of swing i at phases u [n]."""
        return self._pitches[i](np.clip(u, PITCHES[0], PITCHES[-1]))

    def nearest(self, rng, what):
        """Index of a swing like `what`: one of the four nearest."""
        d = np.linalg.norm((self.what - what) / [0.12, 0.08, 0.2, 0.1], axis=1)
        return int(rng.choice(np.argsort(d)[:4]))


def _edges(speed, a, b):
    """The swing around frames a..b widened to where the toe is slow on both sides."""
    while a > 1 and speed[a] > SLOW:
        a -= 1
    while b < len(speed) - 2 and speed[b] > SLOW:
        b += 1
    return a, b


def of_take(positions, rotations):
    """Swings of one retargeted take: rows of (what, way, aside, height, turn, pitch)."""
    rows = []
    for f, (foot, toes) in enumerate(FEET):
        out = 1.0 if f == 0 else -1.0
        toe, z = positions[:, rig.INDEX[toes]], rotations[:, rig.INDEX[foot], :, 2]
        speed = np.linalg.norm(np.gradient(gaussian(toe, 0.7), axis=0)[:, [0, 2]], axis=1) * FPS
        yaw = np.unwrap(np.arctan2(z[:, 0], z[:, 2]))
        pitch = np.arcsin(np.clip(-z[:, 1], -1, 1))
        stand = contacts(toe)
        for (s, a), (b, e) in zip(stand, stand[1:]):
            if not 5 <= b - a <= 30 or a - s < 4 or e - b < 4:
                continue
            a, b = _edges(speed, a, b)
            n = b - a
            if not 8 <= n <= 27 or a < 0.45 * n or b + 0.35 * n > len(toe) - 1:
                continue
            go = (toe[b] - toe[a])[[0, 2]]
            length = np.hypot(*go)
            if not 0.05 < length < 1.6:
                continue
            at = a + PHASES * n
            sample = lambda x, where: np.interp(where, np.arange(len(x)), x)
            way = np.stack([sample(toe[:, c] - toe[a, c], at) for c in (0, 2)], 1)
            line = go / length
            share = way @ line / length
            fwd = np.array([np.sin(yaw[b]), np.cos(yaw[b])])
            left = np.array([fwd[1], -fwd[0]])
            side = (way - share[:, None] * go) @ left * out
            share = (share - share[0]) / (share[-1] - share[0])
            height = sample(toe[:, 1], at)
            height = np.maximum(height - height[0] - PHASES * (height[-1] - height[0]), 0)
            turned = yaw[b] - yaw[a]
            turn = (sample(yaw, at) - yaw[a]) / turned if abs(turned) > 0.15 else share
            flat = 0.5 * (np.median(pitch[max(s, a - n): a - n // 3]) + np.median(pitch[b + n // 3: min(e, b + n)])) if a - n // 3 > s and e > b + n // 3 else 0.0
            tilt = sample(pitch, a + PITCHES * n) - flat
            tilt *= np.minimum(1, np.minimum(PITCHES + 0.4, 1.3 - PITCHES) / 0.2)
            if height.max() < 0.01 or height.max() > 0.25 or share.min() < -0.1 or share.max() > 1.1 or np.abs(tilt).max() > 1.1 or np.abs(turn).max() > 1.4:
                continue
            rows.append((np.array([go @ fwd, go @ left * out, turned * out, n / FPS]), share, side, height, turn, tilt))
    return rows


def gather(takes):
    """Swings of takes [(positions, rotations)], or None where there is not one."""
    rows = [r for p, r_ in takes for r in of_take(p, r_)]
    return Swings(*(np.stack(x) for x in zip(*rows))) if rows else None
