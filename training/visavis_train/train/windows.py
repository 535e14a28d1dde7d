"""Windows of the cache as training batches for the flow: latents and conditioning, with modality dropout."""
import math

import torch
import torch.nn.functional as F

from ..nets.flow import GAZE, USER, Condition
from .geometry import to_local

CONTEXT = 8  # frames that an audio encoder in training hears before a window: a quarter of a second, more than it looks back


def smooth(gaze, window):
    """Centred moving mean over `window` frames of [T]; the ends are held."""
    if window <= 1:
        return gaze
    left = window // 2
    padded = F.pad(gaze[None, None], (left, window - 1 - left), mode="replicate")
    return F.avg_pool1d(padded, window, 1)[0, 0]


def block_users(roots, user, first, blocks):
    """Positions [blocks, 8] of block k - 1 in the agent's frame at the last frame of block k - 1; block 0 starts at frame `first` >= 4."""
    at = torch.arange(first - 4, first - 4 + 4 * blocks).reshape(blocks, 4)
    return to_local(roots[at[:, -1]], user[at][..., [0, 2]].double()).float()


class Windows:
    """Random windows of `blocks` blocks. With `audio`, an encoder in training, the first `live` windows of a batch (or all) take their features
    from the voices (cache made with --waves), with gradients; the others take the cached ones."""

    def __init__(self, cache, blocks, drop=0.05, drop_all=0.1, drop_gaze=0.35, prefix=0.1, jitter=True, audio=None, live=None):
        state = torch.load(cache, weights_only=False, mmap=True)
        self.items = [i for i in state["items"] if len(i["z"][-1]) >= blocks]
        self.mean, self.std, self.blocks = state["latent_mean"], state["latent_std"], blocks
        self.drop, self.drop_all, self.drop_gaze, self.prefix, self.jitter = drop, drop_all, drop_gaze, prefix, jitter
        self.weights = torch.tensor([float(len(i["z"][0])) for i in self.items])
        self.audio, self.live = audio, live

    def place(self, i):
        """A clip, one of its phases, and a block of it to begin at."""
        item = self.items[i]
        phase = int(torch.randint(0, len(item["phases"]), (1,)))
        return item, phase, int(torch.randint(0, len(item["z"][phase]) - self.blocks + 1, (1,)))

    def cut(self, item, phase, at, n):
        first = item["phases"][phase] + 4 * at
        z = item["z"][phase][at:at + n]
        user = block_users(item["roots"], item["user"], first, n)
        frames = slice(first, first + 4 * n)
        agent = item["agent"][frames].float().reshape(n, -1)
        voice = item["voice"][first - 4:first - 4 + 4 * n].float().reshape(n, -1)
        kind = int(torch.randint(0, 8, (1,))) if self.jitter else 2
        gaze = item["gaze"][frames].mean().expand(4 * n) if kind > 3 else smooth(item["gaze"], (1, 30, 60, 120)[kind])[frames]
        flags = torch.tensor([1.0, *map(float, item["has"]), 1.0])
        return z, user, agent, voice, gaze.reshape(n, 4), flags

    def hear(self, places):
        """Agent's and user's features [B, K, 4 D_a] each, straight from the voices."""
        frames = 4 * self.blocks
        waves = torch.zeros(2, len(places), 800 * (CONTEXT + frames))
        for row, (item, phase, at) in enumerate(places):
            for who, wave in enumerate(item["waves"]):
                start = item["phases"][phase] + 4 * at - 4 * who
                if wave is not None:
                    part = wave[800 * max(0, start - CONTEXT):800 * (start + frames)]
                    waves[who, row, -len(part):] = part.float() / 32768
        with torch.autocast("cpu", torch.bfloat16):
            heard = self.audio(waves.flatten(0, 1))[:, CONTEXT:].float().reshape(2, len(places), self.blocks, -1)
        return heard * torch.tensor([place[0]["has"] for place in places]).T[..., None, None]

    def batch(self, size):
        """Latents [B, K, Dz] and their Condition with some modalities dropped."""
        places = [self.place(i) for i in torch.multinomial(self.weights, size, replacement=True).tolist()]
        z, user, agent, voice, gaze, flags = (torch.stack(c) for c in zip(*[self.cut(*p, self.blocks) for p in places]))
        if self.audio is not None:
            live = min(self.live or size, size)
            heard = self.hear(places[:live])
            agent, voice = torch.cat([heard[0], agent[live:]]), torch.cat([heard[1], voice[live:]])
        n = self.blocks
        if self.jitter:
            turn = (torch.randn(size, 1, 1) * 0.02 + torch.randn(size, n, 1) * 0.02)
            shift = torch.randn(size, 1, 1, 2) * 0.02 + torch.randn(size, n, 1, 2) * 0.01
            c, s = turn.cos(), turn.sin()
            user = torch.stack([c * user[..., 0] + s * user[..., 1], c * user[..., 1] - s * user[..., 0]], -1) + shift
        flags = flags[:, None].repeat(1, n, 1)
        keep = (torch.rand(size, 1, 4) >= self.drop).float()
        keep[..., GAZE] = (torch.rand(size, 1) >= self.drop_gaze).float()
        keep = keep * (torch.rand(size, 1, 1) >= self.drop_all).float()
        start = torch.where(torch.rand(size, 1) < self.prefix, torch.randint(1, n, (size, 1)), torch.zeros(size, 1, dtype=torch.long))
        keep = keep * (torch.arange(n)[None] >= start).float()[..., None]
        return z, Condition(user.flatten(2), agent, voice, gaze, flags * keep)
