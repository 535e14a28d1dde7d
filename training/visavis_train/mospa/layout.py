"""The motion vector x [T, 264]: positions, local rotations and velocities of 22 joints (the paper's, on the project's rig).

    0..66     positions: hips in the world, the others relative to the hips, world axes, metres
    66..198   first and second column of the local rotation matrices, the hips' in the world
    198..264  velocities of the joints' world positions, metres a frame; frame 0: zeros
Frame 0's root (floor projection of the hips and their heading) is at the origin facing +Z. A pose has the hips' height and all rotations; where the hips are on the
floor is the sum of their velocities: their position, whose spread is metres, a network gives with centimetres of jitter.
"""
import numpy as np

from ..motion import rig

POSITIONS, ROTATIONS, VELOCITIES = slice(0, 3 * rig.J), slice(3 * rig.J, 9 * rig.J), slice(9 * rig.J, 12 * rig.J)
SIZE = 12 * rig.J


def from_world(positions, rotations, place=None):
    """Positions [T, 22, 3], rotation matrices [T, 22, 3, 3] -> x [T, 264] f32 and a place [3] in frame 0's root."""
    inv = rig.axis_mat("y", -rig.yaw_of(rotations[0, 0]))
    origin = positions[0, 0] * [1, 0, 1]
    p, r = (positions - origin) @ inv.T, inv @ rotations
    relative = p - p[:, :1]
    relative[:, 0] = p[:, 0]
    columns = np.swapaxes(rig.global_to_local(r)[..., :2], -1, -2)
    v = np.diff(p, axis=0, prepend=p[:1])
    n = len(p)
    x = np.concatenate([relative.reshape(n, -1), columns.reshape(n, -1), v.reshape(n, -1)], -1).astype(np.float32)
    return x if place is None else (x, inv @ (np.asarray(place, float) - origin))


def to_world(x):
    """Positions [T, 22, 3] and global rotation matrices of x [T, 264]: the hips' way and height and the rotations of x, bones of the rig."""
    x = np.asarray(x, np.float64)
    six = x[:, ROTATIONS].reshape(len(x), rig.J, 6)
    hips = np.cumsum(x[:, VELOCITIES][:, :3], axis=0)
    hips[:, 1] = x[:, 1]
    a = six[..., :3] / np.sqrt((six[..., :3] ** 2).sum(-1, keepdims=True) + 1e-12)
    b = six[..., 3:] - (a * six[..., 3:]).sum(-1, keepdims=True) * a
    b = b / np.sqrt((b ** 2).sum(-1, keepdims=True) + 1e-12)
    rotations = rig.local_to_global(np.stack([a, b, np.cross(a, b)], -1))
    return rig.fk_global(hips, rotations), rotations


def mirror(x):
    """x [..., 264] as seen in a mirror (left and right exchanged)."""
    polar, axial = np.array([-1, 1, 1], x.dtype), np.array([1, -1, -1, -1, 1, 1], x.dtype)
    joints = lambda part, n, sign: (part.reshape(*x.shape[:-1], rig.J, n)[..., rig.MIRROR, :] * sign).reshape(*x.shape[:-1], n * rig.J)
    return np.concatenate([joints(x[..., POSITIONS], 3, polar), joints(x[..., ROTATIONS], 6, axial), joints(x[..., VELOCITIES], 3, polar)], -1)
