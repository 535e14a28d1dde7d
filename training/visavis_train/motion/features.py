"""Global joint transforms <-> feature vectors x [T, F], F = 3 + 36 J (working representation of Visavis).

x[0:3] = (vx, vz, dyaw): displacement of the root since the previous frame in the previous frame's heading
frame [m/frame] and yaw change [rad/frame]; then 12 icosahedron vertices per joint in this frame's heading frame.
The root is the floor projection of the hips with the yaw of the hips' +Z axis.
"""
import numpy as np

from .rig import J, axis_mat, mat_to_quat, polar, quat_to_mat, wrap, yaw_of

RADIUS = 0.1
F = 3 + 36 * J


def icosahedron():
    """12 vertices of unit circumradius, [12, 3]; sum_v v v^T = 4 I."""
    phi = (1 + 5 ** 0.5) / 2
    rows = []
    for a, b in [(1, phi), (1, -phi), (-1, phi), (-1, -phi)]:
        rows += [(0, a, b), (a, b, 0), (b, 0, a)]
    return np.array(rows) / np.sqrt(1 + phi * phi)


ICO = icosahedron()


def root_of(positions, rotations):
    """Root position on the floor [T, 2] (x, z) and yaw [T] from matrices [T, J, 3, 3]."""
    return positions[:, 0, [0, 2]], yaw_of(rotations[:, 0])


def to_features(positions, quats, radius=RADIUS):
    """positions [T, J, 3], quats [T, J, 4] -> x [T, F]. Row 0 has no displacement (zeros)."""
    rot = quat_to_mat(quats)
    pos = np.asarray(positions, dtype=np.float64)
    root, yaw = root_of(pos, rot)
    inv = axis_mat("y", -yaw)
    base = np.stack([root[:, 0], np.zeros_like(yaw), root[:, 1]], -1)
    p = np.einsum("tab,tjb->tja", inv, pos - base[:, None])
    r = inv[:, None] @ rot
    verts = p[:, :, None] + radius * np.einsum("tjab,vb->tjva", r, ICO)
    x = np.zeros((len(pos), 3 + 36 * pos.shape[1]))
    step = np.einsum("tab,tb->ta", inv[:-1], base[1:] - base[:-1])
    x[1:, 0], x[1:, 1] = step[:, 0], step[:, 2]
    x[1:, 2] = wrap(np.diff(yaw))
    x[:, 3:] = verts.reshape(len(pos), -1)
    return x


def from_features(x, start=(0.0, 0.0), yaw0=0.0, radius=RADIUS):
    """x [T, F] -> positions [T, J, 3], quats [T, J, 4]. `start`, `yaw0`: the root *at row 0*; its displacement is ignored."""
    x = np.asarray(x, dtype=np.float64)
    t = len(x)
    yaw = yaw0 + np.concatenate([[0.0], np.cumsum(x[1:, 2])])
    c, s = np.cos(yaw[:-1]), np.sin(yaw[:-1])
    dx = c * x[1:, 0] + s * x[1:, 1]
    dz = -s * x[1:, 0] + c * x[1:, 1]
    base = np.zeros((t, 3))
    base[:, 0] = start[0] + np.concatenate([[0.0], np.cumsum(dx)])
    base[:, 2] = start[1] + np.concatenate([[0.0], np.cumsum(dz)])
    verts = x[:, 3:].reshape(t, -1, 12, 3)
    p = verts.mean(2)
    a = np.einsum("tjva,vb->tjab", verts - p[:, :, None], ICO) / (4 * radius)
    rot = polar(a)
    fwd = axis_mat("y", yaw)
    pos = np.einsum("tab,tjb->tja", fwd, p) + base[:, None]
    return pos, mat_to_quat(fwd[:, None] @ rot)
