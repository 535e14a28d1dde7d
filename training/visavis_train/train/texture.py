"""How motion moves from frame to frame, which errors of pose hardly weigh: for `train.decoder`.

`Differences`: errors of the joints' first three differences in time, each in units of how much that joint differs in recorded motion. A mean over joints in
metres is made by hands and feet; a trunk that trembles by 0.2 mm a frame, which recorded trunks never do, is lost in it. `Critic`: a small convolutional net
that tells a fraction of a second of decoded motion from recorded motion, where no error can say which of many ways to be quick was meant.
Both see what is played (`played.py`).
"""
import torch
from torch import nn
from torch.func import functional_call

from .geometry import turn

LEAST = (5e-5, 3e-5, 3e-5)  # of the units [m]: less is not seen
ORDERS = 3


def differences(p, order):
    """Positions [B, T, J, 3] -> their difference of that order in time [B, T - order, J, 3]."""
    return p.diff(n=order, dim=1)


class Differences:
    """`p`: recorded positions [B, T, J, 3], whose mean differences are the units."""

    def __init__(self, p):
        self.units = [differences(p, n + 1).norm(dim=-1).mean((0, 1)).clamp(min=least) for n, least in enumerate(LEAST)]

    def loss(self, p, q):
        error = lambda n: ((differences(p - q, n + 1).square().sum(-1) + 1e-12).sqrt() / self.units[n]).mean()
        return sum(map(error, range(ORDERS))) / ORDERS


def seen(p, yaw):
    """Positions [B, T, J, 3] and headings [B, T] -> what a critic sees [B, T - 1, 6 J + 3], in units of about one: positions in the hips' heading frame,
    their velocities, the root's step."""
    base = p[:, :, :1] * torch.tensor([1.0, 0.0, 1.0], device=p.device)
    ahead = lambda v, yaw: (lambda x, z: torch.stack([x, v[..., 1], z], -1))(*turn(-yaw[..., None], v[..., 0], v[..., 2]))
    local = ahead(p - base, yaw)
    step = ahead(base.diff(dim=1), yaw[:, :-1])[:, :, 0, [0, 2]]
    return torch.cat([local[:, 1:].flatten(2), (20 * local.diff(dim=1)).flatten(2), 30 * step, 30 * yaw.diff(dim=1)[..., None]], -1)


class Critic(nn.Module):
    """What is seen of motion [B, T, C] -> scores [B, T']; one score hears of about 0.7 s. `mean`, `std` [C] are of recorded motion."""

    def __init__(self, mean, std, width=64):
        super().__init__()
        self.register_buffer("mean", mean)
        self.register_buffer("std", std.clamp(min=1e-3))
        step = lambda i, stride: [nn.Conv1d(i, width, 5, stride=stride), nn.SiLU()]
        self.layers = nn.Sequential(*step(len(mean), 1), *step(width, 2), *step(width, 2), nn.Conv1d(width, 1, 1))

    def forward(self, x):
        return self.layers(((x - self.mean) / self.std).transpose(1, 2))[:, 0]


def frozen(critic, x):
    """The critic's scores with gradients to `x` alone."""
    return functional_call(critic, {k: v.detach() for k, v in critic.named_parameters()}, (x,))


def told(critic, real, made, slope=0.0):
    """The critic's own loss (hinge); `slope`: weight of its squared gradient at recorded motion (Mescheder et al. 2018)."""
    real = real.detach().requires_grad_(slope > 0)
    score = critic(real)
    loss = (1 - score).clamp(min=0).mean() + (1 + critic(made.detach())).clamp(min=0).mean()
    if slope:
        (g,) = torch.autograd.grad(score.mean(1).sum(), real, create_graph=True)
        loss = loss + slope * g.square().sum((1, 2)).mean()
    return loss


