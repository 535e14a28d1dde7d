"""Trains the flow network on cached latents (x1-prediction, SARAH 3.3).

    python -m visavis_train.train.flow --cache runs/cache --vae runs/vae.pt --out runs/flow.pt --minutes 50

Two regimes share each batch stream: one flow time for the whole window (imputed history, what the reference sampler does), and
history near tau = 1 with the current block at its own flow time (what the single-step student starts from). `--end-to-end` goes on
training an existing flow with the audio encoder unfrozen on raw voices (cache made with --waves); hearing a window takes about six times
as long as its step, so that `--live` hears some of each batch.
"""
import argparse
import os

import torch

from ..nets.flow import FlowNet
from . import common
from .team import Team
from .cache import load_audio, load_vae
from .vae import channel_weights
from .geometry import ROOT, integrate, local_positions, to_world
from .windows import Windows

SIZES = {"base": dict(layers=4, width=256, heads=4, mlp=4, tau_width=128, window_blocks=48, embed_latent=128, embed_user=64, embed_voice=96,
                      embed_gaze=16, user_scale=2.0),
         "paper": dict(layers=4, width=1024, heads=4, mlp=4, tau_width=256, window_blocks=48, embed_latent=512, embed_user=128, embed_voice=256,
                       embed_gaze=32, user_scale=2.0)}


@torch.no_grad()
def latent_metric(vae, mean, std, z, latent_mean, latent_std, root=30.0):
    """How much each direction of a (standardised) latent moves the body: [Dz, Dz], trace Dz.

    Finite differences through the decoder: response of the block's own frames, weighted as in the VAE's loss, and of the world
    positions after it. A latent's plain squared error would lose the root among the other directions."""
    w = channel_weights(len(mean)) / 10
    total = 0
    for row in z:
        base = vae.decoder((row * latent_std + latent_mean)[None])[:, -4:]
        moved = row.repeat(row.shape[-1], 1, 1)
        moved[:, -1] += 0.1 * torch.eye(row.shape[-1])
        y = vae.decoder(moved * latent_std + latent_mean)[:, -4:]
        place = lambda f: to_world(integrate((f * std + mean)[..., :ROOT]), local_positions(f * std + mean)).flatten(1) * root
        d = torch.cat([((y - base) * w.sqrt()).flatten(1) / (4 * len(mean)) ** 0.5, (place(y) - place(base)) / (4 * 22) ** 0.5], 1)
        total = total + d @ d.T
    return total * (len(total) / total.trace())


def x1_error(x1, z, metric):
    """Half plain, half as the body feels it; [B, T]."""
    d = x1 - z
    return 0.5 * d.square().mean(-1) + 0.5 * ((d @ metric) * d).mean(-1)


def noisy(z, tau, eps):
    return tau[..., None] * z + (1 - tau[..., None]) * eps


def shared_loss(net, z, cond, metric, slip):
    """Regime of the reference sampler: one flow time a window. `slip` is the deviation of what history adds to the truth."""
    b = len(z)
    tau = (torch.arange(b)[:, None] + torch.rand(b, 1)) / b
    off = torch.randn_like(z) * (slip * torch.rand(b, 1, 1) * (torch.rand(b, 1, 1) < 0.5))
    with torch.autocast("cpu", torch.bfloat16):
        x1 = net(noisy(z + off, tau, torch.randn_like(z)), tau, cond)
    return x1_error(x1, z, metric).mean()


def apart_loss(net, z, cond, metric, slip):
    """Regime of the student: history at tau_h in 0.8 .. 1, each current block at a flow time of its own."""
    b = len(z)
    tau_h = 0.8 + 0.2 * torch.rand(b, 1)
    tau = torch.where(torch.rand(b, 1) < 0.3, torch.zeros(b, 1), torch.rand(b, 1))
    off = torch.randn_like(z) * (slip * torch.rand(b, 1, 1))
    with torch.autocast("cpu", torch.bfloat16):
        x1 = net.forward_pair(noisy(z + off, tau_h, torch.randn_like(z)), tau_h, noisy(z, tau, torch.randn_like(z)), tau, cond)
    return x1_error(x1, z, metric).mean()


@torch.no_grad()
def error_factor(path, cache, tau=0.8, batches=4):
    """Matrix that turns white noise into noise like the flow's x1 errors at `tau`, in latents as the encoder gives them [Dz, Dz]."""
    state = torch.load(path, weights_only=False)
    net = FlowNet(state["latent"], state["audio"], **state["size"])
    net.load_state_dict(state["ema"])
    data, errors = Windows(os.path.join(cache, "train.pt"), 64), []
    for _ in range(batches):
        z, cond = data.batch(12)
        t = torch.full((len(z), 1), tau)
        errors.append((net(noisy(z, t, torch.randn_like(z)), t, cond) - z)[:, 8:].flatten(0, 1))
    errors = torch.cat(errors) * state["latent_std"]
    covariance = errors.T @ errors / len(errors)
    return torch.linalg.cholesky(covariance + 1e-6 * covariance.trace() / len(covariance) * torch.eye(len(covariance)))


@torch.no_grad()
def validate(net, held, metric):
    """x1 error by flow time, conditional against unconditional, on the same windows and noise each time."""
    out = {}
    with torch.random.fork_rng():
        torch.manual_seed(1)
        batches = [(*held.batch(16), torch.randn(16, held.blocks, len(held.mean))) for _ in range(3)]
    for name, tau in (("0", 0.0), ("3", 0.375), ("6", 0.75)):
        errors, free = [], []
        for z, cond, eps in batches:
            t = torch.full((len(z), 1), tau)
            rows = noisy(z, t, eps)
            errors.append(x1_error(net(rows, t, cond), z, metric)[:, 8:].mean().item())
            free.append(x1_error(net(rows, t, cond.dropped()), z, metric)[:, 8:].mean().item())
        out["val" + name], out["free" + name] = sum(errors) / len(errors), sum(free) / len(free)
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cache", required=True)
    parser.add_argument("--vae", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--size", choices=SIZES, default="base")
    parser.add_argument("--minutes", type=float, default=50)
    parser.add_argument("--batch", type=int, default=32)
    parser.add_argument("--blocks", type=int, default=64)
    parser.add_argument("--lr", type=float, default=1.2e-3)
    parser.add_argument("--apart", type=float, default=0.35, help="share of time on the regime with history and current apart")
    parser.add_argument("--slip", type=float, default=0.15)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1, help="processes, each with batches of its own")
    parser.add_argument("--compile", action="store_true", help="torch.compile the losses: minutes at the start, then a step takes 0.7 of its time")
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--end-to-end", metavar="AUDIO", help="audio checkpoint to train along; needs --init and a cache with voices")
    parser.add_argument("--live", type=int, help="windows of a batch whose voices --end-to-end hears, others taking cached features [all]")
    parser.add_argument("--init", help="flow checkpoint whose weights to start from")
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    torch.manual_seed(0)
    team = Team(args.workers)
    audio = load_audio(args.end_to_end) if args.end_to_end else None
    if audio and args.resume:
        audio.load_state_dict(torch.load(args.out + ".audio", weights_only=False)["trained"])
    train = Windows(os.path.join(args.cache, "train.pt"), args.blocks, audio=audio, live=args.live)
    vae, mean, std, _ = load_vae(args.vae)
    plain = Windows(os.path.join(args.cache, "train.pt"), 16, jitter=False)
    metric = latent_metric(vae, mean, std, plain.batch(24)[0], train.mean, train.std)
    state = torch.load(args.out, weights_only=False) if args.resume else torch.load(args.init, weights_only=False) if args.init else None
    size = state["size"] if state else SIZES[args.size]
    latent, width_a = train.items[0]["z"][0].shape[-1], train.items[0]["agent"].shape[-1]
    net = FlowNet(latent, width_a, **size)
    if state and not args.resume:
        net.load_state_dict(state["net"])
    loop = common.Loop(team, net, args.out, args.minutes, args.lr, average=0.999, resume=args.resume, beside=[audio] if audio else [], size=size,
                       latent=latent, audio=width_a, latent_mean=train.mean, latent_std=train.std, metric=metric)
    heard = loop.averages[0].net if audio else None
    held = Windows(os.path.join(args.cache, "val.pt"), args.blocks, 0, 0, 0, 0, jitter=False, audio=heard)
    team.seed(2 + loop.step)
    share = args.apart / (args.apart + 2.2 * (1 - args.apart))  # a step of the pair regime costs about 2.2 of the other
    which = torch.Generator().manual_seed(loop.step)  # the same regime in all processes: none waits for the dearer one
    kinds = {True: apart_loss, False: shared_loss}
    measure = lambda net: validate(net, held, metric)

    def keep_audio():
        if audio and team.leads:
            common.save(args.out + ".audio", net=heard.state_dict(), trained=audio.state_dict(), spec=audio.spec, features=width_a)

    if args.compile:
        with torch.no_grad():
            apart_loss(net, *train.batch(2), metric, 0), shared_loss(net, *train.batch(2), metric, 0)  # makes the tables
        kinds = {k: torch.compile(f, dynamic=False) for k, f in kinds.items()}
    while loop.progress < 1:
        apart = torch.rand(1, generator=which).item() < share
        z, cond = train.batch(args.batch)
        loss = kinds[apart](net, z, cond, metric, args.slip)
        loop.update(loss, **{"apart" if apart else "shared": loss})
        loop.report(100, measure, 500)
        if loop.step % 500 == 0:
            keep_audio()
    keep_audio()
    loop.finish(measure)


if __name__ == "__main__":
    main()
