"""Feature vectors in torch: positions, roots, gaze, the user in the agent's frame. Batched; metres and radians."""
import torch

from ..motion.features import ICO, RADIUS

ROOT = 3
HEAD = 5
HANDS = (9, 13)
FEET = (16, 17, 20, 21)


def local_positions(x):
    """x [..., F] -> joint positions in the heading frame [..., J, 3]: centroids of the icosahedra."""
    return x[..., ROOT:].unflatten(-1, (-1, 12, 3)).mean(-2)


def local_axes(x, joint):
    """The 3x3 matrix (not yet orthogonal) of one joint in the heading frame [..., 3, 3]."""
    verts = x[..., ROOT + 36 * joint:ROOT + 36 * joint + 36].unflatten(-1, (12, 3))
    verts = verts - verts.mean(-2, keepdim=True)
    return torch.einsum("...va,vb->...ab", verts, torch.as_tensor(ICO, dtype=x.dtype, device=x.device)) / (4 * RADIUS)


def turn(yaw, x, z):
    """(x, z) of a frame of heading `yaw` in its parent's axes."""
    c, s = yaw.cos(), yaw.sin()
    return c * x + s * z, c * z - s * x


def integrate(step, start=None):
    """Root steps [..., T, 3] (vx, vz, dyaw) -> roots after each frame [..., T, 3] (x, z, yaw).

    `start` [..., 3]: the root before row 0 (default the origin facing +Z)."""
    start = torch.zeros_like(step[..., 0, :]) if start is None else start
    yaw = start[..., None, 2] + step[..., 2].cumsum(-1)
    before = torch.cat([start[..., None, 2], yaw[..., :-1]], -1)
    dx, dz = turn(before, step[..., 0], step[..., 1])
    return torch.stack([start[..., None, 0] + dx.cumsum(-1), start[..., None, 1] + dz.cumsum(-1), yaw], -1)


def to_world(roots, p):
    """Points of heading frames: roots [..., 3], p [..., N, 3] -> world [..., N, 3]."""
    x, z = turn(roots[..., None, 2], p[..., 0], p[..., 2])
    return torch.stack([x + roots[..., None, 0], p[..., 1], z + roots[..., None, 1]], -1)


def to_local(roots, xz):
    """World floor points [..., N, 2] in the frames of roots [..., 3]."""
    dx, dz = xz[..., 0] - roots[..., None, 0], xz[..., 1] - roots[..., None, 1]
    return torch.stack(turn(-roots[..., None, 2], dx, dz), -1)


def gaze(roots, x, user, eyes, head_back):
    """SARAH 3.4 for feature vectors [..., F] at roots [..., 3] and the user's head [..., 3]: g [...]."""
    axes = local_axes(x, HEAD)
    head = local_positions(x)[..., HEAD, :]
    eyes, head_back = (torch.as_tensor(v, dtype=x.dtype, device=x.device) for v in (eyes, head_back))
    back = head + axes @ head_back
    front = head + axes @ eyes
    ends = to_world(roots, torch.stack([back, front], -2))
    facing = torch.nn.functional.normalize(ends[..., 1, :] - ends[..., 0, :], dim=-1)
    toward = torch.nn.functional.normalize(user - ends[..., 0, :], dim=-1)
    return (facing * toward).sum(-1)
