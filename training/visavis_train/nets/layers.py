"""Transformer parts shared by the VAE and the flow network (mirrors src/nn).

Attention runs under a banded causal mask. Shapes are written [batch, tokens, width].
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
    order = torch.arange(len(blocks), device=blocks.device)
    gap = blocks[:, None] - blocks[None, :]
    return (order[:, None] >= order[None, :]) & (gap < window)


def bias_of(mask):
    """Additive form of a boolean mask."""
    return torch.zeros(mask.shape, device=mask.device).masked_fill(~mask, -1e9)


def places(positions, blocks, window, head_dim):
    """What attention needs to know about tokens in causal order: cos, sin of their positions and the bias of `band_mask`."""
    return *rotary(positions, head_dim), bias_of(band_mask(blocks, window))


class Past:
    """Rotated keys and values [B, S, H, head_dim] of one layer's earlier tokens, for streaming."""

    def __init__(self):
        self.kv = None

    def __len__(self):
        return 0 if self.kv is None else self.kv[0].shape[1]

    def extend(self, k, v):
        """The earlier tokens with the new ones behind them; call `keep` before the next `extend`."""
        if self.kv is not None:
            k, v = torch.cat([self.kv[0], k], 1), torch.cat([self.kv[1], v], 1)
        self.kv = k, v
        return k, v

    def keep(self, limit, provisional=0):
        """Forgets the last `provisional` tokens and, of the others, all but the last `limit`."""
        end = len(self) - provisional
        self.kv = tuple(t[:, max(0, end - limit):end] for t in self.kv)


class Attention(nn.Module):
    def __init__(self, width, heads):
        super().__init__()
        self.heads = heads
        self.qkv = nn.Linear(width, 3 * width)
        self.proj = nn.Linear(width, width)

    def attend(self, q, k, v, bias):
        """q [B, T, H, hd] over k, v [B, S, H, hd]; bias [T, S]."""
        q, k, v = (t.transpose(1, 2) for t in (q, k, v))
        if q.is_cuda:
            y = F.scaled_dot_product_attention(q, k, v, bias.to(q.dtype))
        else:  # on CPUs the backward pass of this is faster than that of the fused operator
            score = q @ k.transpose(-1, -2) * (1.0 / math.sqrt(q.shape[-1]))
            y = torch.softmax(score.float() + bias, -1).to(v.dtype) @ v
        return y.transpose(1, 2).flatten(2)

    def forward(self, x, place, past=None):
        cos, sin, bias = place
        q, k, v = self.qkv(x).unflatten(-1, (3, self.heads, -1)).unbind(2)
        q, k = rotate(q, cos, sin), rotate(k, cos, sin)
        if past is not None:
            k, v = past.extend(k, v)
        return self.proj(self.attend(q, k, v, bias))


def modulated(x, shift, scale):
    return F.layer_norm(x, x.shape[-1:], eps=EPS) * (1 + scale) + shift


class Layer(nn.Module):
    """Pre-norm transformer layer. Without `tau_width` its norms are affine (VAE); with it, norms and residuals are modulated by the
    flow time's vector c [B, T or 1, tau_width] (AdaLN-Zero, Peebles and Xie 2023)."""

    def __init__(self, width, heads, mlp, tau_width=None):
        super().__init__()
        affine = tau_width is None
        if affine:
            self.ln1 = nn.LayerNorm(width, eps=EPS)
        self.attn = Attention(width, heads)
        if affine:
            self.ln2 = nn.LayerNorm(width, eps=EPS)
        self.fc1 = nn.Linear(width, mlp * width)
        self.fc2 = nn.Linear(mlp * width, width)
        if not affine:
            self.mod = nn.Linear(tau_width, 6 * width)
            nn.init.zeros_(self.mod.weight)
            nn.init.zeros_(self.mod.bias)

    def feed(self, x):
        return self.fc2(gelu(self.fc1(x)))

    def forward(self, x, place, c=None, past=None):
        """x [B, T, width]; `place` from `places`; `past`: this layer's `Past`, when the tokens before x are not in it."""
        if c is None:
            x = x + self.attn(self.ln1(x), place, past)
            return x + self.feed(self.ln2(x))
        shift1, scale1, gate1, shift2, scale2, gate2 = self.mod(F.silu(c)).chunk(6, -1)
        x = x + gate1 * self.attn(modulated(x, shift1, scale1), place, past)
        return x + gate2 * self.feed(modulated(x, shift2, scale2))
