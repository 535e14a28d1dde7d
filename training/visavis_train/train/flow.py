"""Trains the flow network on cached latents (x1-prediction, SARAH 3.3).

    python -m visavis_train.train.flow --cache runs/cache --vae runs/vae.pt --out runs/flow.pt --steps 20000

Two regimes share each batch stream: one flow time for the whole window (imputed history, what the reference sampler does), and
history near tau = 1 with the current block at its own flow time (what the single-step student starts from). `--end-to-end` goes on
training an existing flow with the audio encoder unfrozen on raw voices (--corpus); hearing a window takes about six times
as long as its step, so that `--live` hears some of each batch.
"""
import argparse
import math
import os

import torch

from ..nets.flow import FlowNet
from . import common
from .cache import form_of, load_audio, load_vae
from .common import mixed
from .forms import ICOSAHEDRA
from .geometry import ROOT, integrate, to_world
from .loop import Loop
from .sizes import SIZES
from .team import Team
from .vae import channel_weights
from .windows import Windows, aside, voices_of


@torch.no_grad()
def latent_metric(vae, mean, std, z, latent_mean, latent_std, root=30.0, form=ICOSAHEDRA):
    """How much each direction of a (standardised) latent moves the body: [Dz, Dz], trace Dz.

    Finite differences through the decoder: response of the block's own frames, weighted as in the VAE's loss, and of the world
    positions after it. A latent's plain squared error would lose the root among the other directions."""
    w = channel_weights(len(mean), form=form).to(z.device) / 10
    total = 0
    for row in z:
        base = vae.decoder((row * latent_std + latent_mean)[None])[:, -4:]
        moved = row.repeat(row.shape[-1], 1, 1)
        moved[:, -1] += 0.1 * torch.eye(row.shape[-1], device=z.device)
        y = vae.decoder(moved * latent_std + latent_mean)[:, -4:]
        place = lambda f: to_world(integrate((f * std + mean)[..., :ROOT]), form.points(f * std + mean)).flatten(1) * root
        d = torch.cat([((y - base) * w.sqrt()).flatten(1) / (4 * len(mean)) ** 0.5, (place(y) - place(base)) / (4 * 22) ** 0.5], 1)
        total = total + d @ d.T
    return total * (len(total) / total.trace())


def x1_error(x1, z, metric):
    """Half plain, half as the body feels it; [B, T]."""
    d = x1 - z
    return 0.5 * d.square().mean(-1) + 0.5 * ((d @ metric) * d).mean(-1)


def noisy(z, tau, eps):
    return tau[..., None] * z + (1 - tau[..., None]) * eps


def late_weight(tau, late):
    """Weight of an error at a flow time. x1's error e at tau is an error e / (1 - tau) of the velocity: `late` 2 weighs velocities alike, 0 latents.
    Held from tau 0.9 on, and 1 on average over 0 .. 1."""
    held = (1 - tau).clamp(min=0.1) ** -late
    mean = 0.1 * 0.1 ** -late + (math.log(10) if late == 1 else (0.1 ** (1 - late) - 1) / (late - 1))
    return held / mean


def shared_loss(net, z, cond, metric, slip, weight, late):
    """Regime of the reference sampler: one flow time a window. `slip` is the deviation of what history adds to the truth; `weight` [B, T] that of
    each token, `late` as in `late_weight`."""
    b, uniform = len(z), lambda *shape: torch.rand(*shape, device=z.device)
    tau = (torch.arange(b, device=z.device)[:, None] + uniform(b, 1)) / b
    off = torch.randn_like(z) * (slip * uniform(b, 1, 1) * (uniform(b, 1, 1) < 0.5))
    with mixed(z.device):
        x1 = net(noisy(z + off, tau, torch.randn_like(z)), tau, cond)
    return (x1_error(x1, z, metric) * weight * late_weight(tau, late)).mean()


def apart_loss(net, z, cond, metric, slip, weight, late):
    """Regime of the student: history at tau_h in 0.8 .. 1, each current block at a flow time of its own."""
    b, uniform = len(z), lambda *shape: torch.rand(*shape, device=z.device)
    tau_h = 0.8 + 0.2 * uniform(b, 1)
    tau = uniform(b, 1) * (uniform(b, 1) >= 0.3)
    off = torch.randn_like(z) * (slip * uniform(b, 1, 1))
    with mixed(z.device):
        x1 = net.forward_pair(noisy(z + off, tau_h, torch.randn_like(z)), tau_h, noisy(z, tau, torch.randn_like(z)), tau, cond)
    return (x1_error(x1, z, metric) * weight * late_weight(tau, late)).mean()


def load_flow(path, device="cpu"):
    """The averaged flow or student of a checkpoint, and the checkpoint."""
    state = common.load(path)
    net = FlowNet(state["latent"], state["audio"], **state["size"], sound_features=state.get("sound", 0), embed_activity=state.get("activity", 0))
    net.load_state_dict(state["ema"])
    return net.eval().to(device), state


def described(state):
    """What a checkpoint of a flow or student holds beside weights: its sizes, the standard of its latents, their metric."""
    return {k: state[k] for k in ("size", "latent", "audio", "sound", "activity", "latent_mean", "latent_std", "metric") if k in state}


def widened(weights, before, after):
    """Weights of a network that hears `before` features, for one that hears `after`: what is new counts for nothing at first."""
    name = "embed_sound.0.weight"
    if not before or before == after:
        return weights
    frames, rest = weights[name].split([4 * before, weights[name].shape[1] - 4 * before], 1)
    frames = torch.nn.functional.pad(frames.unflatten(1, (4, before)), (0, after - before)).flatten(1)
    return weights | {name: torch.cat([frames, rest], 1)}


@torch.no_grad()
def error_factor(path, cache, device="cpu", tau=0.8, batches=4):
    """Matrix that turns white noise into noise like the flow's x1 errors at `tau`, in latents as the encoder gives them [Dz, Dz]."""
    net, state = load_flow(path, device)
    data, errors = Windows(os.path.join(cache, "train.pt"), 64, device=device), []
    for _ in range(batches):
        z, cond = data.batch(12)
        t = torch.full((len(z), 1), tau, device=z.device)
        errors.append((net(noisy(z, t, torch.randn_like(z)), t, cond) - z)[:, 8:].flatten(0, 1))
    errors = torch.cat(errors).cpu() * state["latent_std"]
    covariance = errors.T @ errors / len(errors)
    return torch.linalg.cholesky(covariance + 1e-6 * covariance.trace() / len(covariance) * torch.eye(len(covariance))).to(device)


@torch.no_grad()
def validate(net, held, metric):
    """x1 error by flow time, conditional against unconditional, on the same windows and noise each time; `rest`: in blocks in which the corpus' hands
    are still."""
    torch.manual_seed(1)
    out, batches = {}, []
    for _ in range(3):
        place = held.draw(16)
        z, cond = held.batch(16, place)
        batches.append((z, cond, torch.randn_like(z), held.stillness(*place)[:, 8:] == 1))
    for name, tau in (("0", 0.0), ("3", 0.375), ("6", 0.75)):
        errors, free, rest = [], [], []
        for z, cond, eps, still in batches:
            t = torch.full((len(z), 1), tau, device=z.device)
            rows = noisy(z, t, eps)
            error = x1_error(net(rows, t, cond), z, metric)[:, 8:]
            errors.append(error.mean().item())
            rest.append(error[still])
            free.append(x1_error(net(rows, t, cond.dropped()), z, metric)[:, 8:].mean().item())
        out["val" + name], out["free" + name] = sum(errors) / len(errors), sum(free) / len(free)
        if len(rest := torch.cat(rest)):
            out["rest" + name] = rest.mean().item()
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cache", required=True)
    parser.add_argument("--vae", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--size", choices=SIZES, default="base")
    parser.add_argument("--blocks", type=int, default=64)
    parser.add_argument("--apart", type=float, default=0.35, help="share of time on the regime with history and current apart")
    parser.add_argument("--slip", type=float, default=0.15)
    parser.add_argument("--late", type=float, default=0.0, help="weight on late flow times: errors weigh (1 - tau)^-LATE; 2 weighs velocities alike [0]")
    parser.add_argument("--end-to-end", metavar="AUDIO", help="audio checkpoint to train along; needs --init and --corpus")
    parser.add_argument("--corpus", help="corpus of the cache, for --end-to-end")
    parser.add_argument("--live", type=int, help="windows of a batch whose voices --end-to-end hears, others taking cached features [all]")
    parser.add_argument("--react", type=float, default=0.0, help="blocks in which what is heard calls for a reaction weigh 1 + REACT [0]")
    parser.add_argument("--turn", type=float, default=0.0, help="blocks in which the user is seen aside of the heading weigh 1 + TURN [0]")
    parser.add_argument("--fresh", type=float, default=1.0, help="factor on the learning rate of what embeds sounds [1]")
    parser.add_argument("--sounds", type=float, default=1.0, help="how much more often windows with sounds are drawn than their length says [1]")
    parser.add_argument("--away", type=float, default=0.1, help="share of windows in which the user is not seen, beside the dropout of every modality [0.1]")
    parser.add_argument("--quiet", type=float, default=0.5, help="share of windows in which a voice that a clip lacks is heard to be silent: sessions have both [0.5]")
    parser.add_argument("--init", help="flow checkpoint whose weights to start from")
    common.arguments(parser, steps=20000, lr=1.2e-3, batch=32)
    args = parser.parse_args()
    device, team = common.start_process(args), Team(args.workers)
    audio = load_audio(args.end_to_end, device).train() if args.end_to_end else None
    hearing = {"audio": audio, "voices": team.first(lambda: voices_of(args.corpus, "train", device)), "live": args.live} if audio else {}
    train = Windows(os.path.join(args.cache, "train.pt"), args.blocks, device=device, sounds=args.sounds, away=args.away, quiet=args.quiet, **hearing)
    vae, mean, std, kept = load_vae(args.vae, device)
    plain = Windows(os.path.join(args.cache, "train.pt"), 16, jitter=False, device=device)
    metric = latent_metric(vae, mean, std, plain.batch(24)[0], train.mean.to(device), train.std.to(device), form=form_of(kept))
    first = common.load(args.out if args.resume else args.init) if args.resume or args.init else None
    size, latent = first["size"] if first else SIZES[args.size]["flow"], train.z.shape[1]
    size = size | {"embed_latent": max(size["embed_latent"], latent)}  # a narrower one would hide some of the noise
    net = FlowNet(latent, train.audio_features, **size, sound_features=train.sound_features).to(device)
    if first:
        learns = [] if first.get("sound", 0) else [k for k in net.state_dict() if "_sound." in k]
        weights = widened(first["net"], first.get("sound", 0), train.sound_features)
        if net.load_state_dict(weights, strict=False).missing_keys != learns:
            raise SystemExit(f"{args.out if args.resume else args.init} has other sizes than this network")
        metric = first["metric"].to(device) if args.resume else metric
    spoken = {"spec": audio.spec, "features": train.audio_features} if audio else {}
    loop = Loop(team, net, args, average=0.999, beside={"audio": audio} if audio else None, size=size, latent=latent, audio=train.audio_features, sound=train.sound_features,
                latent_mean=train.mean, latent_std=train.std, metric=metric.cpu(), **spoken)
    if audio:
        hearing = {"audio": loop.averages["audio"].net, "voices": team.first(lambda: voices_of(args.corpus, "val", device))}
    held = Windows(os.path.join(args.cache, "val.pt"), args.blocks, 0, 0, 0, 0, jitter=False, device=device, **hearing)
    share = args.apart / (args.apart + 2.2 * (1 - args.apart))  # a step of the pair regime costs about 2.2 of the other
    kinds = {True: apart_loss, False: shared_loss}
    measure = lambda net: validate(net, held, metric)
    if args.compile:
        with torch.no_grad():
            for f in kinds.values():
                f(net, *train.batch(2), metric, 0, 1.0, 0)  # makes the tables
        kinds = {k: torch.compile(f, dynamic=False) for k, f in kinds.items()}
    for step in loop:
        apart = team.draw(args.seed, step) < share  # the same regime in all processes: none waits for the dearer one
        z, cond = train.batch(args.batch)
        # Weights go by what a block is told: by what the data does in it they would change how often that comes out.
        weight = 1 + args.react * train.called(cond) + args.turn * aside(cond)
        loss = kinds[apart](net, z, cond, metric, args.slip, weight / weight.mean(), args.late)
        loop.update(loss, **{"apart" if apart else "shared": loss})
        loop.report(100, measure, 500)
    loop.finish(measure)


if __name__ == "__main__":
    main()
