"""What the offline rivals train on: whole windows, seen from where they begin.

A token is a block of four frames: their features, and where the root is and looks from the window's first frame on. The user and both voices are given for
every frame, the later ones too, the user where it is from the window's first frame.
"""
import os

import torch
import torch.nn.functional as F

from ..motion import rig
from ..nets.flow import GAZE, Condition
from ..nets.vae import BLOCK
from ..train.data import Split
from ..train.forms import ICOSAHEDRA
from ..train.geometry import integrate, to_local
from ..train.vae import channel_weights
from ..train.windows import Windows
from .directions import fit

ROOT = 4                # numbers of the root's place in a frame: x, z, sine and cosine of the yaw
SPAN = 115              # blocks of a window: 2 s that lead in, 13.3 s that are measured
SMOOTH = 31             # frames over which steps are trusted more than places


def placed(roots):
    """Where roots [..., T, 3] are, seen from the first of them: [..., T, 4]."""
    first = roots[..., :1, :]
    xz = to_local(first[..., 0, :], roots[..., :2])
    yaw = roots[..., 2] - first[..., 2]
    return torch.cat([xz, yaw.sin()[..., None], yaw.cos()[..., None]], -1).float()


def averaged(x, frames=SMOOTH):
    """Centred moving mean of [B, T, D] over time, the ends held."""
    held = F.pad(x.transpose(1, 2), (frames // 2, frames // 2), mode="replicate")
    return F.avg_pool1d(held, frames, 1).transpose(1, 2)


def route(steps, place):
    """Roots [B, T, 3] from the steps between frames [B, T, 3] and the places [B, T, 4] of the same motion: steps have the fine movement, places the way."""
    steps = torch.cat([torch.zeros_like(steps[:, :1]), steps[:, 1:]], 1).double()
    yaw = steps[..., 2].cumsum(1)
    off = torch.atan2(place[..., 2], place[..., 3]).double() - yaw
    off = torch.cat([off[:, :1], rig.wrap(off.diff(dim=1))], 1).cumsum(1)
    yaw = yaw + averaged(off[..., None])[..., 0]
    yaw = torch.cat([yaw[:, :1], yaw.diff(dim=1)], 1)
    path = integrate(torch.cat([steps[..., :2], yaw[..., None]], -1))
    return torch.cat([path[..., :2] + averaged(place[..., :2].double() - path[..., :2]), path[..., 2:]], -1)


def weights(features):
    """Of the numbers of a frame, its root's place among them."""
    return torch.cat([channel_weights(features - ROOT), torch.full((ROOT,), 120.0)])


def metric_of(net):
    """How much each direction of blocks moves what weighs: a diagonal [D, D] of trace D."""
    moved = net.decoder.out.weight
    share = (moved.square() * weights(len(moved) // BLOCK).repeat(BLOCK)[:, None]).sum(0).detach()
    return torch.diag(share * (len(share) / share.sum()))


class Whole:
    """Random whole windows of a split: tokens [B, SPAN, D] and their Condition. `codec`: (network, mean, std), fitted here if None."""

    def __init__(self, corpus, cache, split, codec=None, span=SPAN, count=192, drop=0.1, workers=1):
        self.windows = Windows(os.path.join(cache, split + ".pt"), span, jitter=False)
        clips = Split(corpus, split, workers=workers)
        if int(clips.starts[-1]) != int(self.windows.starts[-1]):
            raise SystemExit(f"{cache} is not of the {split} clips of {corpus}")
        self.frames, self.span, self.drop = clips.frames, span, drop
        self.codec = codec or self._codec(count)

    def _codec(self, count, most=160):
        """Directions of blocks, the place of the root among their numbers."""
        x = torch.cat([self.motion(*self.windows.draw(20)) for _ in range(most // 20)])
        mean, std = x.mean((0, 1)), x.std((0, 1)).clamp(min=1e-3)
        end = x.shape[-1] - ROOT
        std[3:end] = std[3:end].unflatten(0, (-1, ICOSAHEDRA.size)).square().mean(-1).sqrt().clamp(min=0.02).repeat_interleave(ICOSAHEDRA.size)
        return fit((x - mean) / std, weights(x.shape[-1]), count), mean, std

    def motion(self, segment, at):
        """Features and places [B, 4 SPAN, F + 4] of windows."""
        now = self.windows.frames(segment, at)[:, 4:]
        return torch.cat([ICOSAHEDRA.of(self.frames[now]), placed(self.windows.roots[now])], -1)

    def condition(self, segment, at):
        w = self.windows
        now = w.frames(segment, at)[:, 4:]
        known = torch.cat([torch.ones(len(at), 1), w.has[segment[:, 0]]], 1)
        return asked(to_local(w.roots[now[:, 0]], w.user[now][..., [0, 2]].double()).float(), w.agent[now].float(), w.voice[now].float(), known,
                     w.gaze[0][now].mean(1))

    def batch(self, size):
        """Tokens [B, SPAN, D] and their conditions, of which some are left out, the gaze score more often."""
        place = self.windows.draw(size)
        net, mean, std = self.codec
        with torch.no_grad():
            z = net.encoder((self.motion(*place) - mean) / std)[0]
        cond = self.condition(*place)
        keep = (torch.rand(size, 1, 4) >= self.drop / 2).float()
        keep[..., GAZE] = (torch.rand(size, 1) >= 0.35).float() if self.drop else 1.0
        cond.flags = cond.flags * keep * (torch.rand(size, 1, 1) >= self.drop).float()
        return z, cond


def asked(user, agent, voice, has, gaze=None):
    """The Condition of whole windows: user [B, T, 2] from where they begin, voices' features [B, T, D_a], has [B, 3] (user, agent's and user's voice);
    gaze [B], or none."""
    b, blocks = len(user), user.shape[1] // 4
    together = lambda x: x.reshape(b, blocks, -1)
    flags = torch.cat([has, torch.full((b, 1), float(gaze is not None))], 1)[:, None].repeat(1, blocks, 1)
    score = torch.zeros(b, blocks, 4) if gaze is None else gaze[:, None, None].expand(b, blocks, 4)
    return Condition(together(user), together(agent), together(voice), score, flags)


def decoded(codec, z):
    """Features [B, T, F] in metres and roots [B, T, 3], from the first frame on, of tokens."""
    net, mean, std = codec
    with torch.no_grad():
        x = net.decoder(z) * std + mean
    return x[..., :-ROOT], route(x[..., :3], x[..., -ROOT:])
