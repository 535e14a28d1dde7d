"""One pass of each network with its cache as explicit tensors, built on the networks of `training/visavis_train/nets`.

Both take past keys `[B, H, hd, P]` and values `[B, H, P, hd]` of P earlier tokens in any order, and give those of the new rows back: who runs
them writes these into a ring. Scores of past and new rows are computed apart, so that no cache is copied. What depends on the flow time or
the block alone comes in ready made, as in the runtime: modulation, projected conditioning, rotary phases, mask.
"""
import math

import torch
from torch import nn
import torch.nn.functional as F

from visavis_train.nets.layers import EPS, gelu


def turned(x, cos, sin):
    """Rotates [B, R, H, hd] by cos, sin [R, 1, hd / 2]."""
    a, b = x.chunk(2, -1)
    return torch.cat([a * cos - b * sin, a * sin + b * cos], -1)


def attend(q, k, v, past_k, past_v, bias):
    """q, k, v [B, R, H, hd] over the past and the rows themselves; bias [R, P + R]. Returns [B, R, H hd]."""
    q = q.transpose(1, 2) * (1.0 / math.sqrt(q.shape[-1]))
    past = past_k.shape[-1]
    score = torch.cat([q @ past_k, q @ k.permute(0, 2, 3, 1)], -1)
    weight = torch.softmax(score + bias, -1)
    out = weight[..., :past] @ past_v + weight[..., past:] @ v.transpose(1, 2)
    return out.transpose(1, 2).flatten(2)


def split(qkv, heads):
    return qkv.unflatten(-1, (3, heads, -1)).unbind(2)


class FlowStep(nn.Module):
    """One evaluation: two guidance branches, each with the newest finished token and the one being made."""

    def __init__(self, net):
        super().__init__()
        self.heads, self.layers = net.heads, net.layers
        wide = net.embed_latent.out_features
        # The embedding of the latent folded into the input projection; its bias is in the projected conditioning.
        self.input = nn.Linear(net.embed_latent.in_features, net.width, bias=False)
        self.input.weight.data = (net.input.weight[:, :wide].double() @ net.embed_latent.weight.double()).float()
        self.out = net.final["out"]

    def forward(self, z, cond, mod, cos, sin, bias, *past):
        """z [2, Dz], cond [2, 2, d] (branch, row), mod [6 L + 2, d], past: keys then values of every layer.
        Returns x1 [2, Dz] of the branches, new keys [L, 2, H, hd], new values likewise, of the finished token."""
        x = self.input(z) + cond
        keys, values, n = [], [], len(self.layers)
        for i, layer in enumerate(self.layers):
            shift1, scale1, gate1, shift2, scale2, gate2 = mod[6 * i:6 * i + 6].unbind(0)
            normed = F.layer_norm(x, x.shape[-1:], eps=EPS) * scale1 + shift1
            q, k, v = split(layer.attn.qkv(normed), self.heads)
            q, k = turned(q, cos, sin), turned(k, cos, sin)
            keys.append(k[:, 0])
            values.append(v[:, 0])
            x = x + gate1 * layer.attn.proj(attend(q, k, v, past[i], past[n + i], bias))
            normed = F.layer_norm(x, x.shape[-1:], eps=EPS) * scale2 + shift2
            x = x + gate2 * layer.fc2(gelu(layer.fc1(normed)))
        x = F.layer_norm(x[:, 1], x.shape[-1:], eps=EPS) * mod[6 * n + 1] + mod[6 * n]
        return self.out(x), torch.stack(keys), torch.stack(values)


class DecoderStep(nn.Module):
    """One block: a latent in, four frames out."""

    def __init__(self, net):
        super().__init__()
        self.heads, self.layers, self.latent, self.ln_f, self.out = net.layers[0].attn.heads, net.layers, net.latent, net.ln_f, net.out
        tokens = net.slot.detach().clone()
        tokens[1:] += net.frame_token.detach()
        tokens[0] += net.latent.bias.detach()
        self.register_buffer("tokens", tokens)
        self.latent = nn.Linear(net.latent.in_features, net.latent.out_features, bias=False)
        self.latent.weight.data = net.latent.weight.detach()

    def forward(self, z, cos, sin, bias, *past):
        """z [1, Dz], unstandardised. Returns frames [4, F], new keys [L, H, hd, 5], new values [L, H, 5, hd]."""
        x = torch.cat([self.latent(z) + self.tokens[:1], self.tokens[1:]], 0)[None]
        keys, values, n = [], [], len(self.layers)
        for i, layer in enumerate(self.layers):
            q, k, v = split(layer.attn.qkv(layer.ln1(x)), self.heads)
            q, k = turned(q, cos, sin), turned(k, cos, sin)
            keys.append(k[0].permute(1, 2, 0))
            values.append(v[0].transpose(0, 1))
            x = x + layer.attn.proj(attend(q, k, v, past[i], past[n + i], bias))
            x = x + layer.fc2(gelu(layer.fc1(layer.ln2(x))))
        return self.out(self.ln_f(x)[0, 1:]), torch.stack(keys), torch.stack(values)
