"""Sampling block by block, as the runtime does (mirrors src/flow's sampler).

`Reference` recomputes every token at every network evaluation. `Stream` keeps one cache of keys and values per flow time
and is exact against it; it rolls out many sequences at once.
"""
import torch

from .flow import GAZE, cat_conditions
from .layers import gelu, modulated, rotary, rotate


def branches(cond, gaze):
    """Conditions of the guidance branches U, C and (with a gaze target) F, stacked along the batch."""
    return cat_conditions([cond.dropped(), cond.dropped(GAZE)] + ([cond] if gaze else []))


def combine(x1, count, guidance, gaze_guidance):
    """x1 of the stacked branches [count * B, ...] -> guided x1 [B, ...]."""
    parts = x1.chunk(count)
    out = parts[0] + guidance * (parts[1] - parts[0])
    return out + gaze_guidance * (parts[2] - parts[1]) if count == 3 else out


def history_time(tau, tau_history=None, clean_from=0.0):
    """Flow time at which history enters an evaluation at `tau`: imputed (at `tau` itself) without `tau_history`; with it, imputed
    below `clean_from` and at least `tau_history` from there. Early evaluations decide what happens and listen to the
    conditions; late ones, over a clean past, join it without a jerk."""
    return tau if tau_history is None or tau < clean_from else max(tau, tau_history)


def midpoint(steps, eps, evaluate):
    """z at tau = 1 from eps; `evaluate(z, tau, slot)` gives the guided x1."""
    z, h = eps, 1.0 / steps
    for i in range(steps):
        tau = i * h
        half = z + 0.5 * h * (evaluate(z, tau, 2 * i) - z) / (1 - tau)
        tau += 0.5 * h
        z = z + h * (evaluate(half, tau, 2 * i + 1) - half) / (1 - tau)
    return z


class Reference:
    """One session, everything recomputed: tokens' latents, noise and conditions are kept for the whole session."""

    def __init__(self, net, guidance, gaze_guidance, clean=None):
        """`clean`: (tau_history, clean_from) of `history_time`, or None to impute history throughout."""
        self.net, self.guidance, self.gaze_guidance, self.clean = net, guidance, gaze_guidance, clean or (None, 0.0)
        self.z, self.eps, self.cond = [], [], []

    def push(self, z, eps, cond):
        """Adds finished tokens [1, N, Dz] with their noise and branch conditions [3, N, ...] (U, C, F)."""
        self.z.append(z)
        self.eps.append(eps)
        self.cond.append(cond)

    def sample(self, eps, cond, steps=4):
        """Samples one token: eps [1, 1, Dz], cond [3, 1, ...]. Returns z [1, 1, Dz] and x1 [NFE, 3, Dz]."""
        done, noise = torch.cat(self.z, 1), torch.cat(self.eps, 1)
        every = cat_conditions(self.cond + [cond], 1)
        seen = []

        def evaluate(z, tau, slot):
            past = history_time(tau, *self.clean)
            rows = torch.cat([past * done + (1 - past) * noise, z], 1).expand(3, -1, -1)
            taus = torch.full((3, rows.shape[1]), float(past))
            taus[:, -1] = tau
            x1 = self.net(rows, taus, every)[:, -1:]
            seen.append(x1[:, 0])
            return combine(x1, 3, self.guidance, self.gaze_guidance)

        return midpoint(steps, eps, evaluate), torch.stack(seen)

    def single(self, eps, cond, tau_history):
        """The single-step student: finished tokens at `tau_history`, the new one at 0, the last branch's condition only."""
        done, noise = torch.cat(self.z, 1), torch.cat(self.eps, 1)
        every = cat_conditions(self.cond + [cond], 1).map(lambda t: t[-1:])
        rows = torch.cat([tau_history * done + (1 - tau_history) * noise, eps], 1)
        tau = torch.full((1, rows.shape[1]), float(tau_history))
        tau[:, -1] = 0
        return self.net(rows, tau, every)[:, -1:]


class Cache:
    """Rotated keys and values of the last window - 1 finished tokens, one ring per layer."""

    def __init__(self, net, batch):
        shape = (len(net.layers), 2, batch, net.window - 1, net.heads, net.head_dim)
        self.kv, self.count = torch.zeros(shape), 0


class Stream:
    """Streams `batch` sequences at once. Time of network evaluations is proportional to the rows, not to the history."""

    def __init__(self, net, batch, guidance=1.3, gaze_guidance=2.5, gaze=False, steps=4, tau_history=None, clean_from=0.0, single=False):
        """`single`: the network is a single-step student, one branch, history always at `tau_history`. `tau_history`,
        `clean_from`: see `history_time`."""
        if single and tau_history is None:
            raise ValueError("a single-step student needs tau_history")
        self.net, self.batch, self.steps, self.single = net, batch, steps, single
        self.past = lambda tau: history_time(tau, tau_history, 0.0 if single else clean_from)
        self.guidance, self.gaze_guidance, self.gaze = guidance, gaze_guidance, gaze
        self.count = 1 if single else (3 if gaze else 2)
        slots = 1 if single else 2 * steps
        self.caches = [Cache(net, self.count * batch) for _ in range(slots)]
        self.previous, self.position = None, 0

    def _stack(self, cond):
        """Embedded conditioning of the branches, once for all evaluations of a block: [count * B, 1, ...]."""
        if self.single:
            return self.net.conditioning(cond if self.gaze else cond.dropped(GAZE))
        return self.net.conditioning(branches(cond, self.gaze))

    def _pass(self, cache, rows, taus, conds):
        """Runs rows [N, R, Dz]; all but the last are finished and enter the cache. Returns x1 of the last row."""
        net, r = self.net, rows.shape[1]
        cos, sin = rotary(torch.arange(self.position - r + 1, self.position + 1), net.head_dim)
        c = net.tau_vector(taus)
        x = net.tokens(rows, conds)
        keep = min(cache.count, net.window - 1)
        for i, layer in enumerate(net.layers):
            shift1, scale1, gate1, shift2, scale2, gate2 = layer.modulation(c)
            q, k, v = layer.attn.qkv(modulated(x, shift1, scale1)).unflatten(-1, (3, net.heads, -1)).unbind(2)
            q, k = rotate(q, cos, sin), rotate(k, cos, sin)
            old_k, old_v = cache.kv[i][:, :, cache.kv.shape[3] - keep:]
            all_k, all_v = torch.cat([old_k, k], 1), torch.cat([old_v, v], 1)
            s = keep + r
            gap = torch.arange(keep, s)[:, None] - torch.arange(s)[None, :]
            bias = torch.zeros(r, s).masked_fill((gap < 0) | (gap >= net.window), -1e9)
            x = x + gate1 * layer.attn.proj(layer.attn.attend(q, all_k, all_v, bias))
            x = x + gate2 * layer.fc2(gelu(layer.fc1(modulated(x, shift2, scale2))))
            if r > 1:
                last = torch.stack([all_k[:, :-1], all_v[:, :-1]])[:, :, -(net.window - 1):]
                cache.kv[i][:, :, cache.kv.shape[3] - last.shape[2]:] = last
        cache.count += r - 1
        return net.finish(x[:, -1:], c[:, -1:])

    @torch.no_grad()
    def warm(self, z, eps, cond):
        """Enters finished tokens [B, N, Dz] (the idle clip's) before the first step."""
        for i in range(z.shape[1]):
            one = lambda t: t[:, i:i + 1]
            if self.previous is not None:
                self._commit(*self.previous)
            self.previous = (one(z), one(eps), self._stack(cond.map(one)))
            self.position += 1

    def _commit(self, z, eps, cond):
        for slot, cache in enumerate(self.caches):
            tau = self.past(0.0 if self.single else slot / (2 * self.steps))
            done = (tau * z + (1 - tau) * eps).expand(self.batch, -1, -1).repeat(self.count, 1, 1)
            dummy = torch.cat([done, done], 1)
            c2 = torch.cat([cond, cond], 1)
            self._pass(cache, dummy, torch.full((1, 2), float(tau)), c2)

    @torch.no_grad()
    def step(self, eps, cond):
        """One block: eps [B, 1, Dz], cond [B, 1, ...] -> z [B, 1, Dz]."""
        now = self._stack(cond)
        before = self.previous

        def rows(z, tau, slot):
            z = z.repeat(self.count, 1, 1)
            if before is None:
                return self._pass(self.caches[slot], z, torch.full((1, 1), float(tau)), now)
            history = self.past(tau)
            done = (history * before[0] + (1 - history) * before[1]).repeat(self.count, 1, 1)
            taus = torch.tensor([[history, tau]], dtype=torch.float32)
            return self._pass(self.caches[slot], torch.cat([done, z], 1), taus, torch.cat([before[2], now], 1))

        if self.single:
            z = rows(eps, 0.0, 0)
        else:
            z = midpoint(self.steps, eps, lambda z, tau, slot: combine(rows(z, tau, slot), self.count, self.guidance, self.gaze_guidance))
        self.previous = (z, eps, now)
        self.position += 1
        return z


class DecoderStream:
    """The VAE's decoder block by block with a cache of keys and values; equals decoding everything at once."""

    def __init__(self, decoder, batch):
        self.net, self.position = decoder, 0
        self.cache = [None] * len(decoder.layers)

    @torch.no_grad()
    def step(self, z):
        """Latents [B, 1, Dz] (not standardised) -> standardised frames [B, 4, F]."""
        net, t = self.net, self.net.tokens
        first = net.latent(z)
        x = torch.cat([first, net.frame_token.expand(len(z), -1, -1)], 1) + net.slot
        cos, sin = rotary(torch.arange(self.position * t, (self.position + 1) * t), net.head_dim)
        causal = torch.zeros(t, t).masked_fill(torch.triu(torch.ones(t, t, dtype=torch.bool), 1), -1e9)
        for i, layer in enumerate(net.layers):
            q, k, v = layer.attn.qkv(layer.ln1(x)).unflatten(-1, (3, layer.attn.heads, -1)).unbind(2)
            q, k = rotate(q, cos, sin), rotate(k, cos, sin)
            if self.cache[i] is not None:
                k, v = torch.cat([self.cache[i][0], k], 1), torch.cat([self.cache[i][1], v], 1)
            self.cache[i] = (k[:, -(net.window - 1) * t:], v[:, -(net.window - 1) * t:]) if net.window > 1 else None
            bias = torch.cat([torch.zeros(t, k.shape[1] - t), causal], 1)
            x = x + layer.attn.proj(layer.attn.attend(q, k, v, bias))
            x = x + layer.fc2(gelu(layer.fc1(layer.ln2(x))))
        self.position += 1
        return net.out(net.ln_f(x)[:, 1:])
