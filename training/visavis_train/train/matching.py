"""Ways for a student to learn a distribution rather than the mean of what its teacher makes; added to the regression of `train.student`.

*Distribution matching* (Yin et al. 2024): the student's blocks are noised again, and moved to where the teacher's idea of clean differs from that of a
`critic`, a copy of the flow that is trained along on the student's own blocks. *Adversarial*: a small convolutional net tells motion
decoded from the student's blocks from decoded motion of the corpus.
"""
import torch
from torch import nn
from torch.func import functional_call

from .common import mixed
from .flow import noisy, x1_error
from .geometry import HANDS, HEAD, local_positions


class Critic:
    """`net`: a copy of the flow, trained along."""

    def __init__(self, net, teacher):
        self.net, self.teacher = net, teacher

    def losses(self, history, tau_history, eps, x1, cond, metric):
        """Of the student's blocks x1 [B, T, Dz] over their history: what moves the student, and the critic's own loss."""
        b, t, _ = x1.shape
        past = noisy(history, tau_history, eps)
        tau = 0.02 + 0.96 * torch.rand(b, t, device=x1.device)
        with mixed(x1.device):
            rows = noisy(x1.detach(), tau, torch.randn_like(x1))
            with torch.no_grad():
                real, made = (net.forward_pair(past, tau_history, rows, tau, cond) for net in (self.teacher, self.net))
            apart = made - real
            size = (x1.detach() - real).abs().mean(-1, keepdim=True).clamp(min=1e-3)
            tau = torch.rand(b, t, device=x1.device)
            told = self.net.forward_pair(past, tau_history, noisy(x1.detach(), tau, torch.randn_like(x1)), tau, cond)
        move = 0.5 * (x1 - (x1 - apart / size).detach()).square().mean()
        return move, x1_error(told, x1.detach(), metric).mean()


class Judge(nn.Module):
    """Decoded frames [B, T, F] in metres -> a score for each quarter of a second or so: positions and velocities of the hands, the head and the root."""

    def __init__(self, width=64):
        super().__init__()
        inputs = 2 * 3 * (len(HANDS) + 1) + 3
        self.layers = nn.Sequential(nn.Conv1d(inputs, width, 5), nn.SiLU(), nn.Conv1d(width, width, 5, stride=2), nn.SiLU(), nn.Conv1d(width, width, 5, stride=2),
                                    nn.SiLU(), nn.Conv1d(width, 1, 3))

    def see(self, x):
        p = local_positions(x)[..., [*HANDS, HEAD], :].flatten(2)
        return torch.cat([2 * p[:, 1:], 60 * p.diff(dim=1), 30 * x[:, 1:, :3]], -1).transpose(1, 2)

    def forward(self, x):
        return self.layers(self.see(x))


class Adversary:
    """`judge` is trained along; `decode` turns latents [B, T, Dz] as the flow has them into frames in metres."""

    def __init__(self, judge, decode):
        self.judge, self.decode = judge, decode

    def losses(self, x1, real):
        """Of the student's blocks and real ones of the same windows [B, T, Dz]: what moves the student, and the judge's own loss (hinge)."""
        made, truth = self.decode(x1), self.decode(real).detach()
        fixed = {k: v.detach() for k, v in self.judge.named_parameters()}
        move = -functional_call(self.judge, fixed, (made,)).mean()
        told = (1 + self.judge(made.detach())).clamp(min=0).mean() + (1 - self.judge(truth)).clamp(min=0).mean()
        return move, told
