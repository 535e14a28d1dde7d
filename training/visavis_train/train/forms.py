"""What a frame is to a network: the root's step, then so many numbers a joint. `ICOSAHEDRA` is the working representation, the others are there to be
compared with it.

A form makes features of compact frames (`data.compact`), and says where the joints are and, if it knows, how they are turned: both in the heading frame.
"""
import torch

from ..motion import rig
from ..motion.features import ICO, RADIUS
from .geometry import ROOT, local_positions


def expand(c):
    """Compact frames [..., 3 + 12 J] -> feature vectors [..., 3 + 36 J], metres."""
    p, r = positions(c), rotations(c)
    verts = p[..., None, :] + RADIUS * torch.einsum("...jab,vb->...jva", r, torch.as_tensor(ICO, dtype=c.dtype, device=c.device))
    return torch.cat([c[..., :ROOT], verts.flatten(-3)], -1)


def positions(c):
    """Joint positions [..., J, 3] of compact frames."""
    joints = (c.shape[-1] - ROOT) // 12
    return c[..., ROOT:ROOT + 3 * joints].unflatten(-1, (joints, 3))


def rotations(c):
    """Rotation matrices [..., J, 3, 3] of compact frames."""
    joints = (c.shape[-1] - ROOT) // 12
    return c[..., ROOT + 3 * joints:].unflatten(-1, (joints, 3, 3))


def upright(six):
    """Two columns [..., 6] -> rotation matrices (Gram-Schmidt)."""
    a, b = six.unflatten(-1, (2, 3)).unbind(-2)
    x = torch.nn.functional.normalize(a, dim=-1)
    y = torch.nn.functional.normalize(b - (x * b).sum(-1, keepdim=True) * x, dim=-1)
    return torch.stack([x, y, torch.linalg.cross(x, y)], -1)


class Icosahedra:
    """Twelve vertices a joint (SARAH 3.1)."""
    name, size, tail = "icosahedra", 36, 0
    of, points = staticmethod(expand), staticmethod(local_positions)

    @staticmethod
    def axes(x):
        """How the joints are turned [..., J, 3, 3], not yet orthogonal."""
        verts = x[..., ROOT:].unflatten(-1, (-1, 12, 3))
        verts = verts - verts.mean(-2, keepdim=True)
        return torch.einsum("...va,vb->...ab", verts, torch.as_tensor(ICO, dtype=x.dtype, device=x.device)) / (4 * RADIUS)

    @staticmethod
    def apart(a, b):
        """Angle between the joints' rotations [..., J], radians, for small ones.

        Vertices turned by a small angle t move by |R - R'| = sqrt(2) t over all axes, and sum_v |X_v|^2 = 4 r^2 |R|^2."""
        axes = lambda f: (lambda v: v - v.mean(-2, keepdim=True))(f[..., ROOT:].unflatten(-1, (-1, 12, 3)))
        return ((axes(a) - axes(b)).square().sum((-1, -2)) + 1e-10).sqrt() / (2 * RADIUS * 2 ** 0.5)


class Positions:
    """Where each joint is, and nothing about how it is turned."""
    name, size, tail = "positions", 3, 0
    of = staticmethod(lambda c: c[..., :ROOT + (c.shape[-1] - ROOT) // 4])
    points = staticmethod(lambda x: x[..., ROOT:].unflatten(-1, (-1, 3)))
    axes = staticmethod(lambda x: None)
    apart = staticmethod(lambda a, b: torch.zeros(*a.shape[:-1], (a.shape[-1] - ROOT) // 3, device=a.device))


class Angles:
    """Rotations relative to the parent joint, two columns of the matrix each, and the height of the hips: positions follow from the rig's bones."""
    name, size, tail = "angles", 6, 1

    @staticmethod
    def of(c):
        r = rotations(c)
        local = torch.cat([r[..., :1, :, :], r[..., rig.PARENTS[1:], :, :].transpose(-1, -2) @ r[..., 1:, :, :]], -3)
        return torch.cat([c[..., :ROOT], local[..., :2].transpose(-1, -2).flatten(-3), positions(c)[..., 0, 1:2]], -1)

    @staticmethod
    def axes(x):
        local, world = upright(x[..., ROOT:-1].unflatten(-1, (-1, 6))).unbind(-3), []
        for j, parent in enumerate(rig.PARENTS):
            world.append(world[parent] @ local[j] if j else local[0])
        return torch.stack(world, -3)

    @classmethod
    def points(cls, x):
        r, offsets = cls.axes(x).unbind(-3), torch.as_tensor(rig.OFFSETS, dtype=x.dtype, device=x.device)
        out = [torch.nn.functional.pad(x[..., -1:], (1, 1))]
        for j, parent in list(enumerate(rig.PARENTS))[1:]:
            out.append(out[parent] + r[parent] @ offsets[j])
        return torch.stack(out, -2)

    @classmethod
    def apart(cls, a, b):
        return ((cls.axes(a) - cls.axes(b)).square().sum((-1, -2)) + 1e-10).sqrt() / 2 ** 0.5


FORMS = {form.name: form for form in (Icosahedra, Positions, Angles)}
ICOSAHEDRA = Icosahedra


def joints_of(features, form=ICOSAHEDRA):
    """Joints of feature vectors of so many numbers."""
    return (features - ROOT - form.tail) // form.size
