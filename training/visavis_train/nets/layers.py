"""Transformer parts shared by the VAE and the flow network (mirrors src/nn).

Attention is plain matmul and softmax under a banded causal mask: on CPUs its backward pass is faster than that of
the fused operator. Shapes are written [batch, tokens, width].
"""
import math

import torch
from torch import nn
import torch.nn.functional as F

EPS = 1e-5
ROTARY_BASE = 10000.0
ROTARY_PERIOD = 2**24


def gelu(x):
    return F.gelu(x, approximate="tanh")


def rotary(positions, head_dim):
    """cos, sin [T, head_dim / 2] of integer token positions [T]; the pair of channel i is (i, i + head_dim / 2).

    Frequencies are whole turns in ROTARY_PERIOD tokens, so that sessions repeat to the bit (src/nn/rope.rs says why)."""
    half = head_dim // 2
    step = 2 * math.pi / ROTARY_PERIOD
    freq = step * torch.round(ROTARY_BASE ** (-torch.arange(half, dtype=torch.float64) / half) / step)
    angle = positions.double()[:, None] * freq
    return angle.cos().float(), angle.sin().float()


def rotate(x, cos, sin):
    """Rotates [B, T, H, head_dim] by its tokens' positions."""
    cos, sin = cos[:, None, :].to(x.dtype), sin[:, None, :].to(x.dtype)
    a, b = x.chunk(2, -1)
    return torch.cat([a * cos - b * sin, a * sin + b * cos], -1)


def band_mask(blocks, window):
    """Boolean [T, T]: may token i (row) see token j? `blocks` [T] is each token's block; tokens are in causal order.

    Block b sees blocks b - window + 1 .. b, and of those only tokens that do not come after it. This is the ring cache's content.
    """
    order = torch.arange(len(blocks))
    gap = blocks[:, None] - blocks[None, :]
    return (order[:, None] >= order[None, :]) & (gap < window)


def bias_of(mask):
    """Additive form of a boolean mask."""
    return torch.zeros(mask.shape).masked_fill(~mask, -1e9)


class Attention(nn.Module):
    def __init__(self, width, heads):
        super().__init__()
        self.heads = heads
        self.qkv = nn.Linear(width, 3 * width)
        self.proj = nn.Linear(width, width)

    def attend(self, q, k, v, bias):
        """q [B, T, H, hd] over k, v [B, S, H, hd]; bias broadcasts to [B, H, T, S]."""
        q, k, v = (t.transpose(1, 2) for t in (q, k, v))
        score = q @ k.transpose(-1, -2) * (1.0 / math.sqrt(q.shape[-1]))
        weight = torch.softmax(score.float() + bias, -1).to(v.dtype)
        return (weight @ v).transpose(1, 2).flatten(2)

    def forward(self, x, cos, sin, bias):
        q, k, v = self.qkv(x).unflatten(-1, (3, self.heads, -1)).unbind(2)
        return self.proj(self.attend(rotate(q, cos, sin), rotate(k, cos, sin), v, bias))


class Layer(nn.Module):
    """Pre-norm transformer layer with affine norms (VAE)."""

    def __init__(self, width, heads, mlp):
        super().__init__()
        self.ln1 = nn.LayerNorm(width, eps=EPS)
        self.attn = Attention(width, heads)
        self.ln2 = nn.LayerNorm(width, eps=EPS)
        self.fc1 = nn.Linear(width, mlp * width)
        self.fc2 = nn.Linear(mlp * width, width)

    def forward(self, x, cos, sin, bias):
        x = x + self.attn(self.ln1(x), cos, sin, bias)
        return x + self.fc2(gelu(self.fc1(self.ln2(x))))


def modulated(x, shift, scale):
    return F.layer_norm(x, x.shape[-1:], eps=EPS) * (1 + scale) + shift


class ModulatedLayer(nn.Module):
    """Pre-norm layer whose norms and residuals are modulated by the flow time (AdaLN-Zero, Peebles and Xie 2023)."""

    def __init__(self, width, heads, mlp, tau_width):
        super().__init__()
        self.attn = Attention(width, heads)
        self.fc1 = nn.Linear(width, mlp * width)
        self.fc2 = nn.Linear(mlp * width, width)
        self.mod = nn.Linear(tau_width, 6 * width)
        nn.init.zeros_(self.mod.weight)
        nn.init.zeros_(self.mod.bias)

    def modulation(self, c):
        """c [B, T or 1, tau_width] -> shift1, scale1, gate1, shift2, scale2, gate2."""
        return self.mod(F.silu(c)).chunk(6, -1)

    def forward(self, x, mod, cos, sin, bias):
        shift1, scale1, gate1, shift2, scale2, gate2 = mod
        x = x + gate1 * self.attn(modulated(x, shift1, scale1), cos, sin, bias)
        return x + gate2 * self.fc2(gelu(self.fc1(modulated(x, shift2, scale2))))
