"""What a body may do: checks that every clip of the corpus passes before it is written.

Limits are those of people with some room: a fast hand of a gesturing speaker reaches 4 to 5 m/s, a kicking foot 9 m/s
(the captured dances hold such frames). Depths and heights allow the few centimetres that capture and retargeting leave.
"""
from dataclasses import dataclass

import numpy as np

from ..motion import rig
from . import check


@dataclass(frozen=True)
class Limits:
    """Greatest joint speed [m/s] and acceleration [m/s2], lowest toe [m], deepest arm in the trunk [m] and the share of
    frames deeper than 2 cm, greatest bone error [m]."""
    speed: float
    accel: float
    toe: float
    trunk: float
    trunk_share: float
    bone: float = 1e-3


SIMULATED = Limits(speed=8.0, accel=150.0, toe=-0.01, trunk=0.06, trunk_share=0.02)
CAPTURED = Limits(speed=9.5, accel=200.0, toe=-0.02, trunk=0.10, trunk_share=0.25)


def faults(positions, rotations, limits):
    """Names of the limits that a clip breaks, empty for a plausible one. Positions [T, 22, 3] metres, rotations [T, 22, 3, 3]."""
    if not (np.isfinite(positions).all() and np.isfinite(rotations).all()):
        return ["not finite"]
    speed = np.linalg.norm(np.diff(positions, axis=0), axis=-1).max() * rig.FPS
    accel = np.linalg.norm(np.diff(positions, 2, axis=0), axis=-1).max() * rig.FPS ** 2
    depth = check.trunk_depth(positions, rotations)
    off = np.abs(np.einsum("tjab,tjcb->tjac", rotations, rotations) - np.eye(3)).max()
    tests = {"speed": speed > limits.speed, "acceleration": accel > limits.accel, "foot below the floor": positions[:, check.FEET, 1].min() < limits.toe,
             "arm in the trunk": depth.max() > limits.trunk or (depth > 0.02).mean() > limits.trunk_share,
             "bone length": check.bone_error(positions) > limits.bone, "rotation not orthogonal": off > 1e-3}
    return [name for name, broken in tests.items() if broken]
