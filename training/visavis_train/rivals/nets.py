"""Networks of the rivals, of the flow network's parts: tokens of four frames, the same conditions, embedded alike."""
import torch
from torch import nn
import torch.nn.functional as F

from ..nets.flow import FlowNet
from ..nets.layers import Past, bias_of, gelu, rotary


class Offline(FlowNet):
    """A diffusion transformer over a whole window: every token sees all others, the later ones too. `keys`: with that many numbers a token of given
    poses to go through (zeros where none is given), and a flag."""

    def __init__(self, latent, audio_features, keys=0, **size):
        super().__init__(latent, audio_features, **size)
        self.keys = nn.Linear(keys + 1, self.width) if keys else None

    def tables(self, count, device):
        cos, sin, _ = super().tables(count, device)
        return cos, sin, torch.zeros(count, count, device=device)

    def forward(self, z, t, cond, keys=None):
        """z [B, T, Dz] after diffusion steps t [B] of 1000 -> the clean motion."""
        c, x = self.tau_vector((t[:, None] + 1) / 1000), self.tokens(z, self.conditioning(cond))
        if keys is not None:
            x = x + self.keys(keys)
        place = self.tables(z.shape[1], z.device)
        for layer in self.layers:
            x = layer(x, place, c)
        return self.finish(x, c).float()


class Speaker(nn.Module):
    """A causal transformer over codes: each token's `groups` codes, one after the other, given the tokens before and the conditions up to its own."""

    def __init__(self, audio_features, codes, groups, inner=128, **size):
        super().__init__()
        self.net = FlowNet(inner, audio_features, **size)
        self.start = nn.Parameter(0.02 * torch.randn(inner))
        self.embed = nn.ModuleList(nn.Embedding(codes, inner) for _ in range(groups))
        self.mix = nn.ModuleList(nn.Linear(inner, 2 * inner) for _ in range(groups))
        self.heads = nn.ModuleList(nn.Linear(2 * inner, codes) for _ in range(groups))
        for e in self.embed:
            nn.init.normal_(e.weight, std=0.05)

    def embedded(self, codes):
        """Sum of the embeddings [B, T, inner] of codes [B, T, groups or fewer]."""
        none = torch.zeros(*codes.shape[:2], len(self.start), device=codes.device)
        return sum((e(codes[..., g]) for g, e in enumerate(self.embed[:codes.shape[-1]])), none)

    def logits(self, hidden, codes):
        """Of group `codes.shape[-1]`, the groups before being known."""
        g = codes.shape[-1]
        return self.heads[g](gelu(self.mix[g](hidden + self.embedded(codes)))).float()

    def loss(self, codes, cond):
        """Mean cross-entropy [nats] of codes [B, T, groups]."""
        start = self.start.expand(len(codes), 1, -1)
        hidden = self.net(torch.cat([start, self.embedded(codes[:, :-1])], 1), torch.ones(len(codes), 1, device=codes.device), cond)
        each = [F.cross_entropy(self.logits(hidden, codes[..., :g]).flatten(0, 1), codes[..., g].flatten()) for g in range(len(self.heads))]
        return sum(each) / len(each)


class Telling:
    """A `Speaker` that goes on token by token, with a cache of keys and values. `generator`: of what is drawn."""

    def __init__(self, speaker, generator, temperature=1.0):
        self.net, self.generator, self.temperature = speaker, generator, temperature
        self.pasts, self.position, self.last = [Past() for _ in speaker.net.layers], 0, None

    @torch.no_grad()
    def step(self, cond, given=None):
        """Codes [B, 1, groups] of the next token under its conditions [B, 1, ...]; `given` ones are taken instead of drawn ones."""
        net, flow = self.net, self.net.net
        batch = len(cond.flags)
        before = net.start.expand(batch, 1, -1) if self.last is None else net.embedded(self.last)
        cos, sin = rotary(torch.arange(self.position, self.position + 1), flow.head_dim)
        seen = torch.ones(1, len(self.pasts[0]) + 1, dtype=torch.bool)
        hidden = flow.run(before, torch.ones(batch, 1), flow.conditioning(cond), (cos, sin, bias_of(seen)), self.pasts)
        for past in self.pasts:
            past.keep(flow.window - 1)
        self.position += 1
        codes = torch.zeros(batch, 1, 0, dtype=torch.long)
        for _ in net.heads if given is None else ():
            odds = torch.softmax(net.logits(hidden, codes) / self.temperature, -1)[:, 0]
            codes = torch.cat([codes, torch.multinomial(odds, 1, generator=self.generator)[:, :, None]], -1)
        self.last = codes if given is None else given
        return self.last
