"""What makes motion like the corpus' where errors of poses say nothing: distributions of speeds and poses, a critic, where the agent looks, feet that stand."""
import math

import torch
import torch.nn.functional as F
from torch import nn

from ..corpus import measures
from ..motion import rig
from ..train.geometry import turn
from . import pose
from .agents import PAST

FPS = rig.FPS
HANDS, ANKLES, HEAD = measures.HANDS, measures.ANKLES, measures.HEAD
TOES = [rig.INDEX["leftToes"], rig.INDEX["rightToes"]]
HANN = torch.tensor(measures.HANN, dtype=torch.float32)
EYES = F.normalize(torch.tensor(rig.EYES - rig.HEAD_BACK, dtype=torch.float32), dim=0)
BACK = torch.tensor(rig.HEAD_BACK, dtype=torch.float32)
BIN = 8                # frames over which speeds are averaged
LEAST = 0.01           # m/s that are added before a logarithm: slower is still


class Body:
    """Joints [B, T, J, 3] of motion y [B, T, D] at roots [B, T, 3]: `local` in the heading frame, `world` from the first root on; the gaze score."""

    def __init__(self, y, roots, user=None):
        self.y = y
        self.local, turns = pose.kinematics(y[..., pose.LEAD:].unflatten(-1, (-1, 6)), y[..., 3])
        base = roots[:, :1, :2].detach()
        at, yaw = (roots[..., :2] - base).float(), roots[..., 2].float()
        x, z = turn(yaw[..., None], self.local[..., 0], self.local[..., 2])
        self.world = torch.stack([x + at[..., None, 0], self.local[..., 1], z + at[..., None, 1]], -1)
        if user is not None:
            spin = lambda v: torch.stack([*(lambda a: (a[0], v[..., 1], a[1]))(turn(yaw, v[..., 0], v[..., 2]))], -1)
            back = self.world[..., HEAD, :] + spin(turns[..., HEAD, :, :] @ BACK)
            there = torch.stack([user[..., 0] - base[..., 0].float(), user[..., 1], user[..., 2] - base[..., 1].float()], -1)
            self.score = (spin(turns[..., HEAD, :, :] @ EYES) * F.normalize(there - back, dim=-1)).sum(-1)


def smoothed(x):
    """Hann-smoothed [B, T, C] -> [B, T - 8, C]."""
    return sum(w * x[:, k:x.shape[1] - 8 + k] for k, w in enumerate(HANN))


def length(x):
    return (x.square().sum(-1) + 1e-8).sqrt()


def bins(x):
    """[B, T, n] -> [B, bins, n], the last frames of T."""
    n = x.shape[1] // BIN
    return x[:, x.shape[1] - n * BIN:].unflatten(1, (n, BIN)).mean(2)


def speeds(body):
    """Logarithms of speeds and accelerations [B, bins, n] in the live frames: hands and head relative to the hips, hips, feet on the floor."""
    w = body.world[:, PAST - 16:]
    rel = smoothed((w[:, :, HANDS + [HEAD, 0]] - torch.cat([w[:, :, :1].expand(-1, -1, 3, -1), torch.zeros_like(w[:, :, :1])], 2)).flatten(2)).unflatten(-1, (-1, 3))
    v, a = length(rel.diff(dim=1) * FPS), length(rel.diff(dim=1, n=2) * FPS ** 2)
    feet = length(w[:, 8:, ANKLES].diff(dim=1)[..., [0, 2]] * FPS)
    rough = length(w[:, 8:, HANDS + [HEAD]].diff(dim=1, n=2) * FPS ** 2)
    return [torch.log(bins(v) + LEAST), torch.log(bins(a) + 10 * LEAST), torch.log(bins(feet) + 2 * LEAST), torch.log(bins(rough) + 50 * LEAST)]


def quantiles(made, real, kinds):
    """Mean distance between the sorted values of `made` and `real` [B, n, C], by kind: `kinds` [B, n, K] bool say which values those are."""
    out, count = 0, 0
    for k in range(kinds.shape[-1]):
        m = kinds[..., k]
        if (n := int(m.sum())) >= 8:
            a, b = made[m].sort(0)[0], real[m].sort(0)[0]
            out, count = out + n * F.smooth_l1_loss(a, b, beta=0.2), count + n
    return out / max(count, 1)


def doing(window):
    """Kinds of moments [B, bins, 4] in the live frames: the agent speaks, the user does, nobody does, nobody has for seconds."""
    share = lambda m: bins(m[:, PAST:, None].float())[..., 0] > 0.5
    speaks, hears = share(window.speaks), share(window.hears)
    quiet = ~(window.speaks | window.hears).any(1)[:, None]
    return torch.stack([speaks, hears & ~speaks, ~hears & ~speaks & ~quiet, quiet.expand_as(speaks)], -1)


def alike(made, real, kinds):
    """Distance of the distributions of speeds."""
    return sum(quantiles(a[:, -kinds.shape[1]:], b[:, -kinds.shape[1]:], kinds) for a, b in zip(speeds(made), speeds(real))) / 4


def poses(made, real, std, directions=96):
    """Sliced distance of the distributions of poses in the live frames (every eighth): joints in the heading frame over the corpus' deviations
    [J, 3], hands and arms alone in half of the directions."""
    of = lambda b: ((b.local[:, PAST::8] - b.local[:, PAST::8, :1] * torch.tensor([1.0, 0.0, 1.0])) / std).flatten(0, 1).flatten(1)
    d = torch.randn(3 * rig.J, directions)
    arms = torch.zeros(rig.J, 3)
    arms[6:14] = 1
    d[:, ::2] *= arms.reshape(-1, 1)
    d = F.normalize(d, dim=0)
    a, b = (of(made) @ d).sort(0)[0], (of(real) @ d).sort(0)[0]
    return F.smooth_l1_loss(a, b, beta=0.2)


def feet(made):
    """Speed of the lower foot on the floor, m/s over 2 cm/s, and joints under the floor."""
    w = made.world[:, PAST - 1:]
    low = w[..., ANKLES, 1] + w[..., TOES, 1]
    v = torch.maximum(*(length(w[:, :, joints].diff(dim=1)[..., [0, 2]] * FPS) for joints in (ANKLES, TOES)))
    rests = (-low[:, 1:] / 0.02).softmax(-1)
    return (rests * (v - 0.02).clamp(min=0)).sum(-1).clamp(max=1).mean() + 20 * (0.005 - w[..., 1]).clamp(min=0).sum(-1).mean()


class Critic(nn.Module):
    """Motion and the agent's voice [B, C, T] -> scores of stretches [B, stretches]."""

    def __init__(self, voice, width=96):
        super().__init__()
        self.body = nn.Conv1d(6 * rig.J + 5, width, 5, stride=2)
        self.voice = nn.Conv1d(voice, width, 5, stride=2)
        self.layers = nn.Sequential(nn.SiLU(), nn.Conv1d(width, width, 5, stride=2), nn.SiLU(), nn.Conv1d(width, width, 3, stride=2), nn.SiLU(), nn.Conv1d(width, 1, 3))

    def see(self, body, voice):
        """What it looks at, of both, over about their deviations."""
        p, y = body.local, body.y
        rel = p - p[:, :, :1] * torch.tensor([1.0, 0.0, 1.0])
        motion = torch.cat([2 * rel[:, 1:].flatten(2), 40 * rel.diff(dim=1).flatten(2), 40 * y[:, 1:, :3], 5 * (y[:, 1:, 3:4] - 0.9), 100 * y[..., 3:4].diff(dim=1)], -1)
        return motion.transpose(1, 2), voice[:, 1:].transpose(1, 2)

    def forward(self, motion, voice):
        return self.layers(self.body(motion) + self.voice(voice))[:, 0]


def own_scores(score, before, wanted, seen, chosen, real):
    """Loss on the gaze score [B, T]: with a target, its mean over about three seconds (`before` [B] holds what was) and, weaker, each frame;
    without, or with the recording's own, the recording's scores, loosely. And the mean that was."""
    mean = score.mean(1)
    slow = 0.7 * before + 0.3 * mean
    reach = (mean - wanted).square() + (slow - wanted).abs() * 0.5 + 0.25 * (score - wanted[:, None]).square().mean(1)
    free = 0.5 * (score - real).square().mean(1)
    told = seen[:, 0] * seen[:, 1]
    return (told * torch.where(chosen, reach, 0.5 * reach + free) + (1 - told) * seen[:, 0] * free).mean(), slow.detach()
