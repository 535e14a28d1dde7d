"""Goes on with the VAE's decoder alone, on latents like those that sessions give it; the encoder, and a flow trained on its latents, stay valid.

    python -m visavis_train.train.decoder --corpus DIR --cache runs/cache --vae runs/vae.pt --flow runs/flow.pt [--student runs/student.pt] \\
        --out runs/vae-fine.pt --steps 500

Half of a batch is corpus motion whose latents get noise like the flow's own errors, with the corpus as target. The other half are latents of
roll-outs, which have no truth: there the decoder stays near what it was, with feet that it means to plant put still, bones of the
rig's lengths, and accelerations (block borders weigh more) held down. `--texture` and `--adversarial`: `texture.py`.
"""
import argparse

import torch

from ..motion import rig
from ..nets.vae import Vae
from . import common, texture
from .cache import load_vae
from .common import mixed
from .data import Motions, Several
from .flow import error_factor, load_flow
from .geometry import FEET, ROOT, integrate, local_positions, to_world
from .loop import Loop
from .played import played
from .student import Rollouts
from .team import Team
from .vae import channel_weights, evaluate, joint_weights, losses
from .windows import Windows

TOES = (FEET[1], FEET[3])
PLANTED = (0.045, 0.006)  # a toe below this height [m] and slower than this [m a frame] is meant to stand
LENGTHS = torch.tensor([float((o ** 2).sum() ** 0.5) for o in rig.OFFSETS[1:]])


def free_losses(y, before, mean, std, weights):
    """Standardised frames [B, T, F] of roll-outs against what the decoder made of them `before`; weighted parts."""
    place = lambda f: to_world(integrate((f * std + mean)[..., :ROOT]), local_positions(f * std + mean))
    p, q = place(y), place(before)
    toes, old = p[:, :, list(TOES)], q[:, :, list(TOES)]
    still = (old[:, 1:, :, 1] < PLANTED[0]) & (old.diff(dim=1).norm(dim=-1) < PLANTED[1])
    slide = ((toes.diff(dim=1)[..., [0, 2]].square().sum(-1) + 1e-8).sqrt() * still).sum() / (still.sum() + 1)
    bones = (p[:, :, 1:] - p[:, :, list(rig.PARENTS[1:])]).norm(dim=-1) - LENGTHS.to(p.device)
    acc = (p.diff(dim=1).diff(dim=1).square().sum(-1) + 1e-8).sqrt().mean(-1)
    border = (torch.arange(acc.shape[1], device=acc.device) % 4 >= 2).float()
    return {"stay": ((y - before).square() * weights).mean(), "free_slide": 10 * slide, "bones": 20 * bones.abs().mean(),
            "jerk": 6 * (acc * (1 + border)).mean()}


class Free:
    """Latents of roll-outs [N, K, Dz] as the decoder gets them, a part of them made anew now and then."""

    def __init__(self, rollouts, net, tau_history, size=48):
        self.rollouts, self.net, self.tau_history, self.size, self.z = rollouts, net, tau_history, size, None

    def refresh(self, batch=12, temperature=0.75):
        w = self.rollouts.windows
        z = self.rollouts.make(self.net, batch, bool(torch.rand(1) < 0.6), self.tau_history, temperature)[1]
        z = z * w.std.to(z.device) + w.mean.to(z.device)
        self.z = z if self.z is None else torch.cat([self.z, z])[-self.size:]

    def sample(self, batch, blocks):
        at = int(torch.randint(0, self.z.shape[1] - blocks + 1, (1,)))
        return self.z[torch.randint(0, len(self.z), (batch,)).to(self.z.device), at:at + blocks]

    def state_dict(self):
        return {"z": self.z}

    def load_state_dict(self, state):
        self.z = state["z"].to(self.rollouts.windows.device)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    for name in ("vae", "out"):
        parser.add_argument(f"--{name}", required=True)
    parser.add_argument("--corpus", required=True, nargs="+", help="several: each gives its part of a batch")
    parser.add_argument("--flow", help="whose errors the noise is like; not needed with --noise 0")
    parser.add_argument("--cache", help="needed with --flow or --student")
    parser.add_argument("--student", help="roll-outs are this network's; without it only noise like the flow's errors is used")
    parser.add_argument("--blocks", type=int, default=32)
    parser.add_argument("--free", type=float, default=1.0, help="factor on the losses of roll-outs")
    parser.add_argument("--smooth", type=float, default=3.0, help="factor on the corpus half's losses of velocities and accelerations")
    parser.add_argument("--noise", type=float, default=1.2, help="greatest noise, in deviations of the flow's errors")
    parser.add_argument("--white", type=float, default=0.0, help="greatest white noise besides, in deviations of the latents [0]")
    parser.add_argument("--captured", type=float, default=3.0, help="captured takes are drawn this many times as often as their length says [3]")
    parser.add_argument("--temperature", type=float, default=0.75, help="scale of the roll-outs' noise, as sessions use it")
    parser.add_argument("--texture", type=float, default=0.0, help="weight of the errors of differences in time, each joint in its own units [0]")
    parser.add_argument("--adversarial", type=float, default=0.0, help="weight of a critic that tells decoded motion from recorded motion [0]")
    parser.add_argument("--slope", type=float, default=0.01, help="weight of that critic's squared gradient at recorded motion, every fourth step [0.01]")
    common.arguments(parser, steps=500, lr=4e-4, batch=8)
    args = parser.parse_args()
    device, team, frames = common.start_process(args), Team(args.workers), 4 * args.blocks
    open_all = lambda split: team.first(lambda: Several([Motions(c, split, captured=args.captured, device=device) for c in args.corpus]))
    train, held = map(open_all, ("train", "val"))
    frozen, mean, std, first = load_vae(args.vae, device)
    frozen.requires_grad_(False)
    net, weights = Vae(len(mean), **first["size"]).to(device), channel_weights(len(mean)).to(device)
    jw = joint_weights((len(mean) - ROOT) // 36).to(device)
    jw = jw / jw.mean()
    net.load_state_dict(first["ema"])
    net.encoder.requires_grad_(False)
    if args.noise and not (args.flow and args.cache):
        raise SystemExit("--noise is like a flow's errors: give --flow and --cache, or --noise 0")
    factor = error_factor(args.flow, args.cache, device) if args.noise else None
    with torch.no_grad(), mixed(device):
        deviation = net.encoder((train.sample(24, frames) - mean) / std)[0].float().flatten(0, 1).std(0)
    free = None
    if args.student:
        student, state = load_flow(args.student, device)
        windows = Windows(f"{args.cache}/train.pt", 64, 0, 0, 0, 0, device=device)
        free = Free(Rollouts(windows, frozen, mean, std), student, state["tau_history"])
    units, critic = None, None
    if args.texture or args.adversarial:
        with torch.no_grad():
            recorded = [played(train.sample(8, frames)) for _ in range(12)]
        units = texture.Differences(torch.cat([p for p, _ in recorded]))
        rows = torch.cat([texture.seen(*r) for r in recorded]).flatten(0, 1)
        critic = texture.Critic(rows.mean(0), rows.std(0)).to(device) if args.adversarial else None
    loop = Loop(team, net, args, warmup=50, average=0.995, memory=free, beside={"critic": critic} if critic else None, size=first["size"], mean=mean.cpu(), std=std.cpu())
    torch.manual_seed(1)
    check = (held.sample(24, frames) - mean) / std
    measure = lambda net: evaluate(net, check, mean, std)
    for step in loop:
        for _ in range(2 if free and free.z is None else 1 if free and step % 60 == 0 else 0):
            free.refresh(temperature=args.temperature)
        x = (train.sample(args.batch, frames) - mean) / std
        with mixed(device):
            with torch.no_grad():
                mu, logvar = (t.float() for t in net.encoder(x))
            amount = lambda most: most * torch.rand(len(mu), 1, 1, device=device)
            z = mu if factor is None else mu + amount(args.noise) * (torch.randn_like(mu) @ factor.T)
            if args.white:
                z = z + amount(args.white) * deviation * torch.randn_like(mu)
            count = len(z)
            if free:
                z = torch.cat([z, free.sample(args.batch, args.blocks)])
                with torch.no_grad():
                    before = frozen.decoder(z[count:]).float()
            y = net.decoder(z).float()
        parts = losses(x, y[:count], mean, std, mu, logvar, weights, jw)
        parts.pop("kl")
        parts |= {k: args.smooth * parts[k] for k in ("velocity", "acceleration")}
        if free:
            parts |= {k: args.free * v for k, v in free_losses(y[count:], before, mean, std, weights).items()}
        if units:
            (p, heading), made = played(x * std + mean), played(y * std + mean)
            if args.texture:
                parts["texture"] = args.texture * units.loss(p, made[0][:count])
            if critic:
                real, shown = texture.seen(p, heading), texture.seen(*made)
                parts["adversarial"] = -args.adversarial * texture.frozen(critic, shown).mean()
                parts["told"] = texture.told(critic, real, shown, args.slope if step % 4 == 0 else 0.0)
        loop.update(sum(parts.values()), **parts)
        loop.report(50, measure, 100)
    loop.finish(measure)


if __name__ == "__main__":
    main()
