"""What the runtime plays of decoded frames, in torch and differentiable (mirrors src/pose/fit.rs): the rig's bones, the root at the hips.

Decoded positions do not keep bone lengths, and decoded hips lie a millimetre beside the root. Nobody sees that: what is compared with recorded motion must
have gone through the fit.
"""
import torch

from ..motion import rig
from .geometry import ROOT, integrate, local_axes, local_positions, to_world

ROTATION_WEIGHT = 4 * 0.1 ** 2 / 12  # as in fit.rs
END_WEIGHT = 10.0
OFFSETS = torch.tensor(rig.OFFSETS, dtype=torch.float32)
CHILDREN = [[c for c in range(rig.J) if rig.PARENTS[c] == j] for j in range(rig.J)]
LIMBS = {j for j in range(rig.J) if rig.NAMES[j].endswith(("UpperArm", "UpperLeg"))}


def polar(a, steps=9):
    """The nearest rotation to matrices [..., 3, 3] of positive determinant, by Newton's iteration for the polar factor (Higham 1986)."""
    for _ in range(steps):
        c0, c1, c2 = a.unbind(-1)
        cofactors = torch.stack([torch.linalg.cross(c1, c2), torch.linalg.cross(c2, c0), torch.linalg.cross(c0, c1)], -1)
        det = (c0 * cofactors[..., 0]).sum(-1)[..., None, None]
        scale = (cofactors.square().sum((-1, -2), keepdim=True) / (det.square() * a.square().sum((-1, -2), keepdim=True)) + 1e-20) ** 0.25
        a = 0.5 * (scale * a + cofactors / (det * scale))
    return a


def limb(middle, end, upper, lower, steps=6):
    """Where the middle joint of a limb goes, from its first: `limb_target` of fit.rs."""
    far = end.norm(dim=-1, keepdim=True).clamp(min=1e-6)
    u = end / far
    along = (middle * u).sum(-1, keepdim=True)
    aside = middle - along * u
    height = (aside.square().sum(-1, keepdim=True) + 1e-12).sqrt()
    decoded = torch.atan2(height, along)
    t = decoded
    for _ in range(steps):
        d = (upper ** 2 + far ** 2 - 2 * upper * far * t.cos()).clamp(min=1e-12).sqrt()
        slope = upper * far * t.sin() / d
        gradient = upper ** 2 * (t - decoded) + END_WEIGHT * (d - lower) * slope
        t = (t - (gradient / (upper ** 2 + END_WEIGHT * slope ** 2)).clamp(-0.5, 0.5)).clamp(0, torch.pi)
    return upper * (t.cos() * u + t.sin() * aside / height)


def fitted(x):
    """Decoded frames [..., F] in metres -> joint positions [..., J, 3] on the rig's bones and the yaw of the fitted hips [...], in the decoded heading frame."""
    decoded, offsets = local_positions(x), OFFSETS.to(x)
    length = offsets.norm(dim=-1)
    placed, yaw = {0: decoded[..., 0, :]}, None
    for j in range(rig.J):
        children, at = CHILDREN[j], placed[j]
        if len(children) > 1:
            away = torch.stack([decoded[..., c, :] - at for c in children], -2)
            a = ROTATION_WEIGHT * local_axes(x, j) + torch.einsum("...ca,cb->...ab", away, offsets[children])
            r = polar(a)
            placed |= {c: at + r @ offsets[c] for c in children}
            yaw = torch.atan2(r[..., 0, 2], r[..., 2, 2]) if j == 0 else yaw
        elif children:
            (c,) = children
            away = decoded[..., c, :] - at
            if j in LIMBS:
                end = CHILDREN[c][0]
                placed[c] = at + limb(away, decoded[..., end, :] - at, length[c], length[end])
            else:
                placed[c] = at + length[c] * away / away.norm(dim=-1, keepdim=True).clamp(min=1e-6)
    return torch.stack([placed[j] for j in range(rig.J)], -2), yaw


def played(x):
    """Decoded frames [B, T, F] in metres -> world positions [B, T, J, 3] on the rig's bones, from the origin, and the hips' heading [B, T]."""
    roots = integrate(x[..., :ROOT])
    p, yaw = fitted(x)
    return to_world(roots, p), roots[..., 2] + yaw
