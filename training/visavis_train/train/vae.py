"""Trains the motion VAE.

    python -m visavis_train.train.vae --corpus DIR --out runs/vae.pt --steps 4000

Loss: standardised features with the root, hands, feet and head weighted up; angles between the joints' rotations; joint positions in metres
after the root is integrated over short horizons, their velocity and acceleration (across block borders above all), speed of feet that the data
keeps planted; KL.
"""
import argparse

import torch

from ..nets.vae import codec
from . import common
from .common import mixed
from .data import Motions, statistics
from .forms import FORMS, ICOSAHEDRA, joints_of
from .geometry import FEET, HANDS, ROOT, integrate, to_world
from .loop import Loop
from .sizes import SIZES
from .team import Team

HORIZON = 16
JOINT_WEIGHTS = {5: 2.0, 8: 1.5, 12: 1.5, 9: 3.0, 13: 3.0, 16: 2.0, 17: 2.0, 20: 2.0, 21: 2.0}


def channel_weights(features, root=120.0, form=ICOSAHEDRA):
    """Weights of the channels; the root has the same share in every form, the hips' height of `Angles` that of a joint."""
    w = joint_weights(joints_of(features, form)).repeat_interleave(form.size)
    return torch.cat([torch.full((ROOT,), root * form.size / 36), w, torch.full((form.tail,), float(form.size))])


def joint_weights(joints):
    return torch.tensor([JOINT_WEIGHTS.get(j, 1.0) for j in range(joints)])


def world(x, horizon, form=ICOSAHEDRA):
    """Feature vectors [B, T, F] -> world positions [B, T / horizon, horizon, J, 3], each stretch from the origin."""
    x = x.unflatten(1, (-1, horizon))
    return to_world(integrate(x[..., :ROOT]), form.points(x))


rotations_apart = ICOSAHEDRA.apart


def divergence(mu, logvar):
    """KL to a unit normal, the sum over dimensions."""
    return 0.5 * (mu.square() + logvar.exp() - 1 - logvar).sum(-1).mean()


def losses(x, y, mean, std, mu, logvar, weights, jw, form=ICOSAHEDRA):
    """x, y standardised [B, T, F]; returns the parts, already weighted. Without `logvar` there is no divergence."""
    feature = ((x - y).square() * weights).mean()
    a, b = x * std + mean, y * std + mean
    p, q = world(a, HORIZON, form), world(b, HORIZON, form)
    rotation = (form.apart(a, b) * jw).mean()
    norm = lambda d, w=1.0: ((d.square().sum(-1) + 1e-8).sqrt() * jw * w).mean()
    vp, vq = p.diff(dim=2), q.diff(dim=2)
    border = 1 + 2.0 * (torch.arange(HORIZON - 2, device=x.device) % 4 >= 2).float()[:, None]  # accelerations across block borders weigh more
    feet = list(FEET)
    planted = (vp[..., feet, :].square().sum(-1) < 0.002 ** 2).float()
    slide = ((vq[..., feet, :].square().sum(-1) + 1e-8).sqrt() * planted).sum() / (planted.sum() + 1)
    kl = {} if logvar is None else {"kl": divergence(mu, logvar)}
    return {"feature": feature, "rotation": 2.5 * rotation, "position": 4 * norm(p - q), "velocity": 20 * norm(vp - vq), "acceleration": 10 * norm(vp.diff(dim=2) - vq.diff(dim=2), border),
            "slide": 5 * slide} | kl


def start_from_principal(net, x, weights):
    """First and last maps start at the principal components of (weighted) frames: the network begins with the pose basis."""
    scale = weights.sqrt()
    _, s, v = torch.linalg.svd((x * scale)[torch.randperm(len(x))[:20000].to(x.device)], full_matrices=False)
    width = net.encoder.frame.out_features
    sd, v = s[:width] / min(len(x), 20000) ** 0.5, v[:width]
    with torch.no_grad():
        net.encoder.frame.weight[:len(v)] = v * scale / (sd + 0.05)[:, None]
        net.encoder.frame.bias.zero_()
        net.decoder.out.weight[:, :len(v)] = (v / scale).T * (sd + 0.01)
        net.decoder.out.bias.zero_()


@torch.no_grad()
def evaluate(net, x, mean, std, form=ICOSAHEDRA):
    """Reconstruction of standardised x [B, T, F] (from the means): errors in millimetres and degrees, root apart."""
    y = net(x, noise=False)[0]
    a, b = x * std + mean, y * std + mean
    pa, pb = form.points(a), form.points(b)
    error = (pa - pb).norm(dim=-1) * 1000
    ra, rb = integrate(a[..., :ROOT]), integrate(b[..., :ROOT])
    drift = (ra - rb)[..., :2].norm(dim=-1) * 1000
    pa, pb = to_world(ra, pa), to_world(rb, pb)
    feet = list(FEET)
    va, vb = pa.diff(dim=1)[:, :, feet], pb.diff(dim=1)[:, :, feet]
    planted = va.norm(dim=-1) < 0.002
    acc = pb.diff(dim=1).diff(dim=1).norm(dim=-1).mean(-1)
    border = torch.arange(acc.shape[1], device=acc.device) % 4 >= 2
    return {"rotation_deg": 57.3 * form.apart(a, b).mean().item(), "joints_mm": error.mean().item(), "hands_mm": error[..., list(HANDS)].mean().item(), "feet_mm": error[..., feet].mean().item(),
            "root_step_mm": ((a - b)[..., :2].norm(dim=-1) * 1000).mean().item(), "root_1s_mm": drift[:, 29].mean().item(),
            "root_end_mm": drift[:, -1].mean().item(), "yaw_end_deg": (ra - rb)[:, -1, 2].abs().mean().item() * 57.3,
            "slide_mm": (vb.norm(dim=-1)[planted].mean() * 1000).item(), "seam": (acc[:, border].mean() / acc[:, ~border].mean()).item()}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--size", choices=SIZES, default="base")
    parser.add_argument("--blocks", type=int, default=32)
    parser.add_argument("--kl", type=float, default=2e-5)
    parser.add_argument("--limit", type=int, help="take at most this many clips")
    parser.add_argument("--captured", type=float, default=3.0, help="captured takes are drawn this many times as often as their length says")
    parser.add_argument("--init", help="checkpoint whose weights to start from (schedule starts anew)")
    parser.add_argument("--smooth", type=float, default=1.0, help="factor on the loss of velocities and accelerations")
    parser.add_argument("--rough", type=float, default=0.0, help="greatest white noise on the latents that are decoded, in deviations of the latents [0]: makes "
                        "small noise mean little motion")
    parser.add_argument("--form", choices=FORMS, default="icosahedra", help="what a frame is to the network [icosahedra]")
    parser.add_argument("--plain", action="store_true", help="no interleaved tokens: a block's latent is of its four frames, one after the other")
    parser.add_argument("--codes", type=int, help="a latent is four of so many codes each (VQ-VAE) instead of a distribution")
    parser.add_argument("--evaluate", metavar="SPLIT", help="only print how well --out reconstructs that split")
    common.arguments(parser, steps=4000, lr=1.5e-3, batch=16)
    args = parser.parse_args()
    device = common.start_process(args)
    if args.evaluate:
        state = common.load(args.out)
        net, form = codec(len(state["mean"]), state["size"]), FORMS[state.get("form", "icosahedra")]
        net.load_state_dict(state["ema"])
        x = (Motions(args.corpus, args.evaluate, args.limit, form=form).sample(48, 4 * args.blocks) - state["mean"]) / state["std"]
        return print({k: round(v, 2) for k, v in evaluate(net.eval(), x, state["mean"], state["std"], form).items()})
    team = Team(args.workers)
    first = common.load(args.out if args.resume else args.init) if args.resume or args.init else None
    form = FORMS[first.get("form", "icosahedra") if first else args.form]
    motions = lambda split, **kw: team.first(lambda: Motions(args.corpus, split, args.limit, device=device, workers=args.workers, form=form, **kw))
    train, held = motions("train", captured=args.captured), motions("val")
    if not train.size:
        raise SystemExit(f"no clips under {args.corpus}/train: build the corpus first (python -m visavis_train.corpus)")
    size = first["size"] if first else SIZES[args.size]["vae"] | ({"interleaved": False} if args.plain else {}) | ({"codes": args.codes} if args.codes else {})
    mean, std, every = (*(first[k].to(device) for k in ("mean", "std")), None) if first else statistics(train)
    features = len(mean)
    net, weights, frames = codec(features, size).to(device), channel_weights(features, form=form).to(device), 4 * args.blocks
    jw = joint_weights(joints_of(features, form)).to(device)
    jw = jw / jw.mean()
    if first:
        net.load_state_dict(first["net"])
    else:
        start_from_principal(net, (every - mean) / std, weights)
        if net.quantiser:
            net.quantiser.begin(net.encoder((train.sample(64, frames) - mean) / std)[0])
        del every
    loop = Loop(team, net, args, size=size, form=form.name, mean=mean.cpu(), std=std.cpu())
    torch.manual_seed(1)
    check = ((held if held.size else train).sample(32, frames) - mean) / std
    measure = lambda net: evaluate(net, check, mean, std, form)
    scale = {"kl": args.kl, "velocity": args.smooth, "acceleration": args.smooth}

    def forward(x):
        with mixed(device):
            y, mu, logvar = net(x, rough=args.rough)
        parts = losses(x, y, mean, std, mu, logvar, weights, jw, form)
        if net.quantiser:
            parts["codes"] = net.quantiser.loss(mu)
        return sum(scale.get(k, 1.0) * v for k, v in parts.items()), parts

    if args.compile:
        with torch.no_grad():
            net(check[:2])  # makes the tables
        forward = torch.compile(forward, dynamic=False)
    for _ in loop:
        loss, parts = forward((train.sample(args.batch, frames) - mean) / std)
        loop.update(loss, **parts)
        loop.report(100, measure, 200)
    loop.finish(measure)


if __name__ == "__main__":
    main()
