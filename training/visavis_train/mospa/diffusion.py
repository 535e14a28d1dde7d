"""The noise schedule (cosine, Nichol and Dhariwal 2021) and sampling in few steps (Song et al. 2021, eta 0)."""
import functools

import torch


@functools.cache
def kept(steps=1000):
    """Share of the signal's power after each step, [steps] f64."""
    f = torch.cos((torch.arange(steps + 1, dtype=torch.float64) / steps + 0.008) / 1.008 * torch.pi / 2) ** 2
    return torch.cumprod(1 - (1 - f[1:] / f[:-1]).clamp(max=0.999), 0)


def noised(x, t, noise):
    """x [B, T, D] after steps t [B]."""
    a = kept().to(x.device)[t][:, None, None]
    return a.sqrt().float() * x + (1 - a).sqrt().float() * noise


def times(steps):
    """The steps that are visited, ascending."""
    if not 1 <= steps <= 1000:
        raise ValueError(f"{steps} sampling steps: 1 to 1000")
    return [(i + 1) * 1000 // steps - 1 for i in range(steps)]


@torch.no_grad()
def sample(net, noise, steps, *given):
    """Standardised motion [B, T, D] from noise of that shape; `net(x, t, *given)` tells the clean motion."""
    x, every, a = noise, times(steps), kept()
    for i in range(steps - 1, -1, -1):
        clean = net(x, torch.full((len(x),), every[i], device=x.device), *given).float()
        if i == 0:
            return clean
        now, then = a[every[i]], a[every[i - 1]]
        away = (x - now.sqrt().float() * clean) / (1 - now).sqrt().float()
        x = then.sqrt().float() * clean + (1 - then).sqrt().float() * away


def motions(net, split, which, steps, seed=0, batch=32, genre=None):
    """Motion [n, T, 264] (array, metres) for clips `which` of a split; noise by the seed and the clip's number."""
    out = []
    for k in range(0, len(which), batch):
        some = which[k:k + batch]
        given = split.given(net, some)
        if genre is not None:
            given = given[:2] + (torch.full_like(given[2], genre),)
        noise = torch.stack([torch.randn(net.frames, len(net.motion_mean), generator=torch.Generator().manual_seed(1000003 * seed + i)) for i in some])
        out.append(net.unstandardise(sample(net, noise, steps, *given)))
    return torch.cat(out).numpy()
