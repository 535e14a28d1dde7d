"""The denoiser: an encoder-only transformer from a noisy motion, both ears' features, the source's place, the sensitivity and the diffusion step to the
clean motion (the paper's; mirrored by the runtime). Frames go in patches of `patch`: the paper's tokens are single frames (patch 1), which two cores cannot train."""
import torch
from torch import nn

from ..nets.layers import Attention, EPS, Layer, gelu
from . import features, layout

HEAD_HEIGHT, LIMIT, UNKNOWN = 1.6, 8.0, 3            # of the head at frame 0; of standardised features; genre that is not given
SIZES = {"frames": 240, "patch": 8, "width": 192, "heads": 8, "layers": 4, "mlp": 4, "diffusion_steps": 1000, "steps": 100}


def wave(n, width):
    """Cosines and sines [..., width] of numbers [...]."""
    half = width // 2
    angle = n[..., None].float() * 10000.0 ** (-torch.arange(half, dtype=torch.float32, device=n.device) / half)
    return torch.cat([angle.cos(), angle.sin()], -1)


def source_row(place, known):
    """Row [..., 5] of a place [..., 3] in frame 0's root, metres: direction from the head, log of the distance, 1; zeros where `known` [...] is 0."""
    d = place - place.new_tensor([0.0, HEAD_HEIGHT, 0.0])
    r = (d.square().sum(-1, keepdim=True) + 0.01).sqrt()
    return torch.cat([d / r, r.log(), torch.ones_like(r)], -1) * known[..., None]


class Full(Attention):
    """Every token sees every token."""

    def forward(self, x, place=None, past=None):
        q, k, v = self.qkv(x).unflatten(-1, (3, self.heads, -1)).unbind(2)
        return self.proj(self.attend(q, k, v, 0.0))


class Mospa(nn.Module):
    def __init__(self, frames, patch, width, heads, layers, mlp, **_):
        super().__init__()
        if frames % patch or width % (2 * heads):
            raise ValueError(f"{frames} frames in patches of {patch}, width {width} in {heads} heads: patch must divide frames, 2 heads the width")
        self.frames, self.patch = frames, patch
        self.step1, self.step2 = nn.Linear(width, width), nn.Linear(width, width)
        self.genre = nn.Parameter(torch.randn(UNKNOWN + 1, width) * 0.02)
        self.source1, self.source2 = nn.Linear(5, width), nn.Linear(width, width)
        self.audio = nn.Linear(patch * 2 * features.SIZE, width)
        self.motion = nn.Linear(patch * layout.SIZE, width)
        self.slots = nn.Parameter(torch.randn(4, width) * 0.02)
        self.layers = nn.ModuleList(Layer(width, heads, mlp) for _ in range(layers))
        for layer in self.layers:
            layer.attn = Full(width, heads)
        self.ln_f, self.out = nn.LayerNorm(width, eps=EPS), nn.Linear(width, patch * layout.SIZE)
        nn.init.zeros_(self.out.weight)              # begins at the mean pose, without jitter
        nn.init.zeros_(self.out.bias)
        for name, size in (("motion", layout.SIZE), ("feature", features.SIZE)):
            self.register_buffer(name + "_mean", torch.zeros(size))
            self.register_buffer(name + "_std", torch.ones(size))

    @property
    def width(self):
        return self.genre.shape[1]

    def hear(self, left, right):
        """Standardised features [B, T, 2 F] of both ears' [B, T, F]."""
        return torch.cat([((e.float() - self.feature_mean) / self.feature_std).clamp(-LIMIT, LIMIT) for e in (left, right)], -1)

    def standardise(self, x):
        return (x - self.motion_mean) / self.motion_std

    def unstandardise(self, x):
        return x * self.motion_std + self.motion_mean

    def forward(self, x, t, heard, row, genre):
        """x [B, T, D] standardised and noisy, t [B] diffusion steps, heard [B, T, 2 F], row [B, 5], genre [B] -> clean x [B, T, D]."""
        b, s = len(x), self.slots
        when = wave(torch.arange(self.frames // self.patch, device=x.device), self.width)
        patches = lambda v: v.reshape(b, -1, self.patch * v.shape[-1])
        lead = [(self.step2(nn.functional.silu(self.step1(wave(t, self.width)))) + s[0])[:, None], (self.genre[genre] + s[1])[:, None],
                (self.source2(gelu(self.source1(row))) + s[2])[:, None]]
        # a patch hears its own sound and is told of the rest at once: by attention alone that takes thousands of steps to learn
        tokens = [*lead, self.motion(patches(x)) + self.audio(patches(heard)) + when + s[3] + sum(lead)]
        h = torch.cat(tokens, 1)
        for layer in self.layers:
            h = layer(h, None)
        return self.out(self.ln_f(h[:, len(lead):])).reshape(x.shape)
