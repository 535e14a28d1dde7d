"""Sampling block by block, as the runtime does (mirrors src/flow's sampler).

`Reference` recomputes every token at every network evaluation. `Stream` keeps one cache of keys and values per flow time
and is exact against it; it rolls out many sequences at once.
"""
import torch

from .flow import GAZE, cat_conditions
from .layers import Past, bias_of, rotary
from .vae import Stack


def branches(cond, gaze):
    """Conditions of the guidance branches U, C and (with a gaze target) F, stacked along the batch."""
    return cat_conditions([cond.dropped(), cond.dropped(GAZE)] + ([cond] if gaze else []))


def combine(x1, count, guidance, gaze_guidance):
    """x1 of the stacked branches [count * B, ...] -> guided x1 [B, ...]; `guidance`: one weight, or one a token [B, T, 1]."""
    parts = x1.chunk(count)
    out = parts[0] + guidance * (parts[1] - parts[0])
    return out + gaze_guidance * (parts[2] - parts[1]) if count == 3 else out


def history_time(tau, tau_history=None, clean_from=0.0):
    """Flow time at which history enters an evaluation at `tau`: imputed (at `tau` itself) without `tau_history`; with it, imputed
    below `clean_from` and at least `tau_history` from there. Early evaluations decide what happens and listen to the
    conditions; late ones, over a clean past, join it without a jerk."""
    return tau if tau_history is None or tau < clean_from else max(tau, tau_history)


def guides(tau, guided_until=None):
    """Whether an evaluation at `tau` is guided: those from `guided_until` on are conditional alone, gaze target included."""
    return guided_until is None or tau < guided_until


def reacting(guidance, share, further):
    """Guidance weights [B, T, 1] while what is heard calls for a reaction, by `share` [B, T] 0 to 1: `guidance - 1` grows to `further` times that."""
    return guidance + share[..., None] * (further - 1) * (guidance - 1)


class Sampler:
    """Midpoint rule over flow times `edges` (ascending, 0 to 1): two evaluations an interval.

    The last interval is two Euler steps over the same flow times and ends at the last x1. By the midpoint rule it would end at twice that
    less the x1 before, which adds up the errors of both: as fidgeting, where a body is at rest."""

    def __init__(self, edges):
        self.edges = list(edges)
        if len(self.edges) < 2 or self.edges[0] != 0 or self.edges[-1] != 1 or any(b <= a for a, b in zip(self.edges, self.edges[1:])):
            raise ValueError(f"flow times must rise from 0 to 1: {self.edges}")
        self.taus = [tau for a, b in zip(self.edges, self.edges[1:]) for tau in (a, a + 0.5 * (b - a))]

    def run(self, eps, evaluate):
        """z at tau = 1 from eps; `evaluate(z, tau, slot)` gives the guided x1."""
        z = eps
        for i, (tau, end) in enumerate(zip(self.edges, self.edges[1:])):
            h = end - tau
            half = z + 0.5 * h * (evaluate(z, tau, 2 * i) - z) / (1 - tau)
            tau += 0.5 * h
            x1 = evaluate(half, tau, 2 * i + 1)
            z = z + h * (x1 - half) / (1 - tau) if end < 1 else x1
        return z


def sampler(steps):
    """A `Sampler` of so many equal steps, or of the flow times between its steps."""
    return Sampler([i / steps for i in range(steps + 1)] if isinstance(steps, int) else steps)


def midpoint(steps, eps, evaluate):
    return sampler(steps).run(eps, evaluate)


class Reference:
    """One session, everything recomputed: tokens' latents, noise and conditions are kept for the whole session."""

    def __init__(self, net, guidance, gaze_guidance, clean=None, guided_until=None):
        """`clean`: (tau_history, clean_from) of `history_time`, or None to impute history throughout; `guided_until`: see `guides`."""
        self.net, self.guidance, self.gaze_guidance, self.clean, self.guided_until = net, guidance, gaze_guidance, clean or (None, 0.0), guided_until
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
            return combine(x1, 3, self.guidance, self.gaze_guidance) if guides(tau, self.guided_until) else x1[2:]

        return midpoint(steps, eps, evaluate), torch.stack(seen)

    def single(self, eps, cond, tau_history):
        """The single-step student: finished tokens at `tau_history`, the new one at 0, the last branch's condition only."""
        done, noise = torch.cat(self.z, 1), torch.cat(self.eps, 1)
        every = cat_conditions(self.cond + [cond], 1).map(lambda t: t[-1:])
        rows = torch.cat([tau_history * done + (1 - tau_history) * noise, eps], 1)
        tau = torch.full((1, rows.shape[1]), float(tau_history))
        tau[:, -1] = 0
        return self.net(rows, tau, every)[:, -1:]


class Stream:
    """Streams `batch` sequences at once. Time of network evaluations is proportional to the rows, not to the history."""

    def __init__(self, net, batch, guidance=1.3, gaze_guidance=2.5, gaze=False, steps=4, tau_history=None, clean_from=0.0, single=False,
                 guided_until=None):
        """`single`: the network is a single-step student, one branch, history always at `tau_history`. `tau_history`,
        `clean_from`: see `history_time`; `guided_until`: see `guides`."""
        if single and tau_history is None:
            raise ValueError("a single-step student needs tau_history")
        self.net, self.batch, self.single, self.device = net, batch, single, net.input.weight.device
        self.plan = sampler(steps)
        self.past = lambda tau: history_time(tau, tau_history, 0.0 if single else clean_from)
        self.guidance, self.gaze_guidance, self.gaze, self.guided_until = guidance, gaze_guidance, gaze, guided_until
        self.count = 1 if single else (3 if gaze else 2)
        self.taus = [0.0] if single else self.plan.taus
        self.pasts = [[Past() for _ in net.layers] for _ in self.taus]
        self.previous, self.position = None, 0

    def _stack(self, cond):
        """Embedded conditioning of the branches, once for all evaluations of a block: [count * B, 1, ...]."""
        if self.single:
            return self.net.conditioning(cond if self.gaze else cond.dropped(GAZE))
        return self.net.conditioning(branches(cond, self.gaze))

    def _pass(self, slot, rows, taus, conds):
        """Runs rows [N, R, Dz]; all but the last are finished and stay in the slot's past. Returns x1 of the last row."""
        net, r, pasts = self.net, rows.shape[1], self.pasts[slot]
        s = len(pasts[0]) + r
        cos, sin = rotary(torch.arange(self.position - r + 1, self.position + 1, device=self.device), net.head_dim)
        gap = torch.arange(s - r, s, device=self.device)[:, None] - torch.arange(s, device=self.device)[None, :]
        x1 = net.run(rows, taus, conds, (cos, sin, bias_of((gap >= 0) & (gap < net.window))), pasts)
        for past in pasts:
            past.keep(net.window - 1, provisional=1)
        return x1[:, -1:]

    @torch.no_grad()
    def warm(self, z, eps, cond):
        """Enters finished tokens [B, N, Dz] (the idle clip's) before the first step."""
        for i in range(z.shape[1]):
            one = slice(i, i + 1)
            if self.previous is not None:
                self._commit(*self.previous)
            self.previous = z[:, one], eps[:, one], self._stack(cond.at(one))
            self.position += 1

    def _commit(self, z, eps, cond):
        """Enters a finished token into the pasts of all slots: the pass needs a row after it, whose result is not used."""
        for slot, at in enumerate(self.taus):
            tau = self.past(at)
            done = (tau * z + (1 - tau) * eps).expand(self.batch, -1, -1).repeat(self.count, 1, 1)
            self._pass(slot, torch.cat([done, done], 1), torch.full((1, 2), float(tau), device=self.device), torch.cat([cond, cond], 1))

    @torch.no_grad()
    def step(self, eps, cond, guidance=None):
        """One block: eps [B, 1, Dz], cond [B, 1, ...] -> z [B, 1, Dz]; `guidance`: weights [B, 1, 1] of this block, instead of the stream's."""
        now = self._stack(cond)
        before = self.previous

        def rows(z, tau, slot):
            z = z.repeat(self.count, 1, 1)
            if before is None:
                return self._pass(slot, z, torch.full((1, 1), float(tau), device=self.device), now)
            history = self.past(tau)
            done = (history * before[0] + (1 - history) * before[1]).repeat(self.count, 1, 1)
            taus = torch.tensor([[history, tau]], dtype=torch.float32, device=self.device)
            return self._pass(slot, torch.cat([done, z], 1), taus, torch.cat([before[2], now], 1))

        if self.single:
            z = rows(eps, 0.0, 0)
        else:
            weight = self.guidance if guidance is None else guidance
            guided = lambda x1, tau: combine(x1, self.count, weight, self.gaze_guidance) if guides(tau, self.guided_until) else x1[-self.batch:]
            z = self.plan.run(eps, lambda z, tau, slot: guided(rows(z, tau, slot), tau))
        self.previous = (z, eps, now)
        self.position += 1
        return z


def decoding(decoder):
    """What turns latents [B, 1, Dz] (not standardised) into standardised frames [B, 4, F], block by block."""
    return DecoderStream(decoder).step if isinstance(decoder, Stack) else decoder


class DecoderStream:
    """The VAE's decoder block by block with a cache of keys and values; equals decoding everything at once."""

    def __init__(self, decoder):
        self.net, self.position = decoder, 0
        self.pasts = [Past() for _ in decoder.layers]

    @torch.no_grad()
    def step(self, z):
        """Latents [B, 1, Dz] (not standardised) -> standardised frames [B, 4, F]."""
        net, t, device = self.net, self.net.tokens, z.device
        x = net.enter(z)[:, 0] + net.slot
        cos, sin = rotary(torch.arange(self.position * t, (self.position + 1) * t, device=device), net.head_dim)
        seen = torch.ones(t, len(self.pasts[0]) + t, dtype=torch.bool, device=device)
        place = cos, sin, bias_of(seen.tril(len(self.pasts[0])))
        for layer, past in zip(net.layers, self.pasts):
            x = layer(x, place, past=past)
            past.keep((net.window - 1) * t)
        self.position += 1
        return net.leave(net.ln_f(x))
