"""Trains the denoiser to give back the clean motion.

    python -m visavis_train.mospa.train --corpus WORK/mospa/corpus --out runs/mospa.pt --steps 2300 --batch 16
    python -m visavis_train.mospa.train --corpus ... --out runs/small.pt --width 96 --layers 2 --steps 300 --lr 2e-3 [--no-genre]        an ablation

The paper's: squared error of motion and of its change from frame to frame, of joints by forward kinematics and their change, of the feet's velocity, of the way
and the rotations once more. Ours: errors in standardised units and metres; noisy steps more often than others; smoothness, feet and way weigh little at first; the genre is left out in a tenth of the clips and the place in a fifth, as hosts may leave them out.
"""
import argparse

import numpy as np
import torch

from ..dram import pose
from ..motion import rig
from ..train import common
from ..train.common import mixed
from ..train.loop import Loop
from ..train.team import Team
from . import diffusion, layout, nets, react
from .data import Split, off_source

FEET = [rig.INDEX[n] for n in ("leftFoot", "leftToes", "rightFoot", "rightToes")]
NO_GENRE, NO_PLACE = 0.1, 0.2
FIRMER = 9.0                                     # what smoothness, feet and way weigh more at the end, from half of the steps on: first where to, then how
NOISY = 3.0                                      # the power that favours noisy steps: from step 900 down a clip's numbers, which go together, show through the noise
EVERY = 16                                       # forward kinematics of every sixteenth pair of frames: the loss' cost


def change(x):
    return x[:, 1:] - x[:, :-1]


def way(x):
    """The hips' way [B, T, 3] of motion [B, T, 264] in metres, as poses have it (`layout.to_world`)."""
    v = x[..., layout.VELOCITIES]
    return torch.stack([v[..., 0].cumsum(1), x[..., 1], v[..., 2].cumsum(1)], -1)


def joints(x):
    """Positions relative to the hips [B, T, 22, 3] of motion [B, T, 264] in metres, by forward kinematics."""
    return pose.kinematics(pose.orthonormal(x[..., layout.ROTATIONS].unflatten(-1, (rig.J, 6))))[0]


def losses(net, made, clean, firm=1.0):
    """The paper's terms of standardised motions [B, T, D]; the sum and its parts. `firm`: weight of smoothness, feet and way."""
    error, moved = made - clean, change(made) - change(clean)
    plain, smooth, turn = error.square().mean(), moved.square().mean(), error[..., layout.ROTATIONS].square().mean()
    first = torch.arange(int(torch.randint(EVERY, (1,))), made.shape[1] - 1, EVERY)
    at = torch.stack([first, first + 1], 1).flatten()
    made, clean = net.unstandardise(made), net.unstandardise(clean)
    gone = way(made) - way(clean)
    off = joints(made[:, at]) - joints(clean[:, at])
    steps = change((off + gone[:, at, None]).unflatten(1, (-1, 2)).transpose(1, 2))[:, 0] * rig.FPS
    places, path, feet = off.square().sum(-1).mean(), gone.square().sum(-1).mean(), steps[:, :, FEET].square().sum(-1).mean()
    # gradients of like norms: at ten and more times these weights, those of the feet and the way are all that a step follows
    free = smooth + 0.03 * path + 0.001 * (steps.square().sum(-1).mean() + feet)
    return plain + turn + 3 * places + firm * free, {"plain": plain, "smooth": smooth, "places": places, "path": path, "feet": feet}


def build(args, data):
    net = nets.Mospa(**nets.SIZES | {k: getattr(args, k) for k in ("patch", "width", "heads", "layers")})
    for name, value in data.statistics().items():
        getattr(net, name).copy_(value)
    return net


def drop(given, genre, no_genre=NO_GENRE):
    """Leaves out the genre of some clips and the place of others."""
    heard, row, kind = given
    kind = torch.where(torch.rand(len(kind)) < no_genre, nets.UNKNOWN, kind) if genre else torch.full_like(kind, nets.UNKNOWN)
    return heard, row * (torch.rand(len(row), 1) >= NO_PLACE), kind


def train(args):
    team = Team(1)
    torch.manual_seed(args.seed)
    data, held = Split(args.corpus, "train"), Split(args.corpus, "val")
    net = build(args, data)
    sizes = nets.SIZES | {k: getattr(args, k) for k in ("patch", "width", "heads", "layers")}
    loop = Loop(team, net, args, warmup=60, average=0.995, sizes=sizes, genre=not args.no_genre)
    check = list(range(0, len(held), 2))
    x = torch.from_numpy(held.poses(check))
    noise = torch.randn(x.shape, generator=torch.Generator().manual_seed(5))

    turning = [k for k, i in enumerate(check) if held.clips[i]["reaction"] in react.TURNS]

    def angle(net, given):
        """Median angle in degrees, of clips that end facing the source, to it: 90 where the network, asked for a clip out of noise alone, does not heed the place."""
        made = net.unstandardise(net(noise, torch.full((len(x),), 999), *given).float()).numpy()
        return float(np.degrees(np.median([off_source(made[k], held.clips[check[k]], held.location[check[k]])[0] for k in turning] or [np.nan])))

    @torch.no_grad()
    def measure(net):
        given, clean = held.given(net, check), net.standardise(x)
        given = given if not args.no_genre else given[:2] + (torch.full_like(given[2], nets.UNKNOWN),)
        with mixed(args.device):
            error = lambda t: (net(diffusion.noised(clean, torch.full((len(x),), t), noise), torch.full((len(x),), t), *given).float() - clean).square().mean().item()
            return {f"val_{t}": error(t) for t in (999, 500, 100)} | {"val_angle": angle(net, given)}

    for _ in loop:
        which = torch.randint(2 * len(data), (args.batch,)).tolist()
        given = drop(data.given(net, which), not args.no_genre)
        clean = net.standardise(torch.from_numpy(data.poses(which)))
        t = (1000 * (1 - torch.rand(args.batch) ** NOISY)).long().clamp(max=999)
        with mixed(args.device):
            made = net(diffusion.noised(clean, t, torch.randn_like(clean)), t, *given)
        loss, parts = losses(net, made.float(), clean, 1 + FIRMER * max(0.0, 2 * loop.progress - 1))
        loop.update(loss, **parts)
        loop.report(50, measure, 200)
    loop.finish(measure)


def load(path):
    """The averaged network of a checkpoint, and the checkpoint."""
    state = common.load(path)
    net = nets.Mospa(**state["sizes"])
    net.load_state_dict(state["ema"])
    return net.eval(), state


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--corpus", required=True, help="folder of visavis_train.mospa.corpus")
    parser.add_argument("--out", required=True, help="checkpoint")
    for name in ("patch", "width", "heads", "layers"):
        parser.add_argument("--" + name, type=int, default=nets.SIZES[name])
    parser.add_argument("--no-genre", action="store_true", help="the ablation without the sensitivity")
    common.arguments(parser, steps=3000, lr=1e-3, batch=32)
    args = parser.parse_args()
    common.start_process(args)
    train(args)


if __name__ == "__main__":
    main()
