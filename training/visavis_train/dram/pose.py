"""Poses of the featherweight tier: y [D] = vx, vz, dyaw, hips height, then six numbers a joint.

The root is that of `motion/features.py`: floor projection of the hips with their heading; (vx, vz, dyaw) is its step since the frame before, in
that frame's heading frame. A joint's six numbers are the first and the second column of its local rotation (Zhou et al. 2019); the hips' is
relative to the heading. The paper has quaternions: q and -q are one rotation, so |f_d - f_m| and a mean squared error would depend on a sign
that means nothing; six numbers are continuous and need a Gram-Schmidt step, no eigenvalues. Bones have the rig's lengths.
"""
from dataclasses import dataclass

import numpy as np
import torch

from ..motion import rig

LEAD = 4                                             # numbers before the joints
WHOLE = tuple(range(rig.J))
# the second configuration, for the paper's table: twelve joints above the legs, no translation
UPPER = tuple(rig.INDEX[n] for n in ("hips", "spine", "chest", "upperChest", "neck", "head", "leftShoulder", "leftUpperArm", "leftLowerArm",
                                     "rightShoulder", "rightUpperArm", "rightLowerArm"))
OFFSETS = torch.tensor(rig.OFFSETS, dtype=torch.float32)


@dataclass(frozen=True)
class Layout:
    """Which joints a model moves, and whether it moves the root."""
    joints: tuple = WHOLE
    root: bool = True

    @property
    def lead(self):
        return LEAD if self.root else 0

    @property
    def size(self):
        return self.lead + 6 * len(self.joints)

    def take(self, y):
        """The numbers of this layout among those of the whole body, [..., D]."""
        parts = [y[..., :LEAD]] if self.root else []
        return torch.cat(parts + [y[..., LEAD:].unflatten(-1, (-1, 6))[..., list(self.joints), :].flatten(-2)], -1)

    def per_joint(self, delta):
        """Mean of a joint's numbers [..., D] -> [..., joints]; the root's count with the hips."""
        six = delta[..., self.lead:].unflatten(-1, (-1, 6))
        out = six.mean(-1)
        if self.root:
            hips = (delta[..., :LEAD].sum(-1) + six[..., 0, :].sum(-1)) / (LEAD + 6)
            out = torch.cat([hips[..., None], out[..., 1:]], -1)
        return out


def orthonormal(six):
    """Gram-Schmidt on [..., 6]; the two columns again."""
    a, b = six[..., :3], six[..., 3:]
    a = a * (a.square().sum(-1, keepdim=True) + 1e-12).rsqrt()
    b = b - (a * b).sum(-1, keepdim=True) * a
    b = b * (b.square().sum(-1, keepdim=True) + 1e-12).rsqrt()
    return torch.cat([a, b], -1)


def matrices(six):
    """Orthonormal columns [..., 6] -> rotation matrices [..., 3, 3]."""
    a, b = six[..., :3], six[..., 3:]
    (ax, ay, az), (bx, by, bz) = a.unbind(-1), b.unbind(-1)
    return torch.stack([a, b, torch.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], -1)], -1)


def from_world(positions, rotations):
    """positions [T, J, 3], rotation matrices [T, J, 3, 3] in the world (arrays) -> y [T, D] f32 and roots [T, 3] f64. Row 0 has no step."""
    root, yaw = positions[:, 0, [0, 2]], np.unwrap(rig.yaw_of(rotations[:, 0]))
    local = rig.global_to_local(rotations)
    local[:, 0] = rig.axis_mat("y", -yaw) @ rotations[:, 0]
    y = np.zeros((len(root), LEAD + 6 * rig.J))
    d = np.diff(root, axis=0)
    c, s = np.cos(yaw[:-1]), np.sin(yaw[:-1])
    y[1:, 0], y[1:, 1], y[1:, 2] = c * d[:, 0] - s * d[:, 1], c * d[:, 1] + s * d[:, 0], np.diff(yaw)
    y[:, 3] = positions[:, 0, 1]
    y[:, LEAD:] = np.swapaxes(local[..., :2], -1, -2).reshape(len(root), -1)
    return torch.from_numpy(y.astype(np.float32)), torch.from_numpy(np.concatenate([root, yaw[:, None]], -1))


def kinematics(six, height=None):
    """Joint positions [..., J, 3] and rotations [..., J, 3, 3] in the heading frame, from columns [..., J, 6] and the hips' height [...]."""
    local = matrices(six).unbind(-3)   # apart: a joint's gradient need not fill all joints
    zero = torch.zeros_like(local[0][..., 0])
    at = zero if height is None else torch.stack([torch.zeros_like(height), height, torch.zeros_like(height)], -1)
    places, turns = [at], [local[0]]
    offsets = OFFSETS.to(six)
    for j in range(1, rig.J):
        p = rig.PARENTS[j]
        places.append(places[p] + turns[p] @ offsets[j])
        turns.append(turns[p] @ local[j])
    return torch.stack(places, -2), torch.stack(turns, -3)
