"""Trains the tier: recorded poses with noise on the history, then the model's own poses, in every step.

    python -m visavis_train.dram.train --data WORK/dram --out runs/dram-tcn.pt --backbone tcn --minutes 12
    python -m visavis_train.dram.train --data WORK/dram --out runs/table --table --steps 800      all rows of the paper's table

The paper's: squared error of the next pose. Ours: errors in units of each joint's usual step, so that the root and calm joints do not drown; noise
on the history, of which forecasts keep `KEPT`, so that a drifting pose is brought back smoothly; roll-outs of up to --own frames behind each
window, whose length is scheduled, with an error k frames on weighing 1 / k^1.5; modality dropout.
"""
import argparse
import os

import torch

from ..train import common
from ..train.common import mixed
from ..train.loop import Loop
from ..train.team import Team
from . import nets, pose, roll
from .data import Split

LAYOUTS = {"whole": pose.Layout(), "upper": pose.Layout(pose.UPPER, False)}
SIZES = {"tcn": {"monadic": {"width": 128, "dilations": [1, 2, 4, 8, 16]}, "dyadic": {"width": 128, "dilations": [1, 2, 4, 8, 16, 32]}},
         "lstm": {"monadic": {"width": 128, "layers": 2}, "dyadic": {"width": 128, "layers": 2}}}
# the table's: networks of one backbone get the weights of both
SMALL = {"tcn": {"monadic": {"width": 64, "dilations": [1, 2, 4, 8, 16]}, "dyadic": {"width": 64, "dilations": [1, 2, 4, 8, 16, 32]}},
         "lstm": {"monadic": {"width": 64, "layers": 2}, "dyadic": {"width": 64, "layers": 2}}}
SINGLE = 92
WARM, FIRST, CHECK = 5, 96, 24   # first frame of a window that is forecast, of its roll-out; roll-out of the validation
MEMORY, KEPT = 0.93, 0.85        # of the noise on the history, from frame to frame; of that, what a forecast keeps


def build(args, features, data, layout):
    sizes = SIZES[args.backbone] if args.layout == "whole" else SMALL[args.backbone]
    if args.variant not in ("dram", "no-attention"):
        sizes = {"dyadic": sizes["dyadic"] | {"width": SINGLE if args.layout == "upper" else 184}}
    net = nets.Dram(layout.size, features, args.backbone, sizes, args.variant)
    for name, value in zip(("mean", "std", "step"), data.statistics(layout)):
        getattr(net, name).copy_(value)
    return net, sizes


def noise(p, step, most):
    """Slow noise [B, T, D] of up to `most` usual steps a frame; a third of the windows have none."""
    size = most * torch.rand(len(p), 1) * (torch.rand(len(p), 1) > 1 / 3)
    out, n = [], torch.randn_like(p[:, 0]) * size
    for _ in range(p.shape[1]):
        out.append(n)
        n = MEMORY * n + (1 - MEMORY ** 2) ** 0.5 * size * torch.randn_like(n)
    return torch.stack(out, 1) * step * 3


def losses(net, window, layout, own, most=0.5):
    """Error of forecasts from recorded (noisy) poses, and of a roll-out of `own` frames behind them, in usual steps."""
    clean = roll.standardise(net, layout.take(window.y))
    off = noise(clean, net.step, most)
    history = clean + off
    out, _, state = roll.forced(net, window, layout, WARM, FIRST, history)
    out, state = out.float(), roll.each(torch.Tensor.float, state)
    wanted = clean[:, WARM:FIRST] + (0 if net.absolute else KEPT * off[:, WARM - 1:FIRST - 1])
    near = ((out - wanted) / net.step)[:, 16:].clamp(-30, 30).square().mean()
    if not own or net.absolute:
        return near, near.new_zeros(())
    run = roll.Run(net, layout, history[:, FIRST - 1], history[:, FIRST - 2], state, window.roots[:, FIRST - 1] if layout.root else None)
    far = 0
    for k in range(own):
        run.step(window.heard(FIRST + k, FIRST + k + 1, run.root[:, None] if layout.root else None))
        wanted = clean[:, FIRST + k] + KEPT ** (k + 1) * off[:, FIRST - 1]
        far = far + ((run.p - wanted) / net.step).square().mean() / (k + 1) ** 1.5
    return near, far / own


def train(args, out, data, held):
    team, layout = Team(1), LAYOUTS[args.layout]
    torch.manual_seed(args.seed)
    net, sizes = build(args, data.agent.shape[1], data, layout)
    if args.init:
        net.load_state_dict(common.load(args.init)["ema"])
    args.out = out
    loop = Loop(team, net, args, warmup=50, average=0.995, backbone=args.backbone, sizes=sizes, variant=args.variant, layout=args.layout,
                features=data.agent.shape[1])
    spread = held.spread(48, FIRST + CHECK + 1)
    check = held.at([c for c, _ in spread], [a for _, a in spread], FIRST + CHECK + 1)

    @torch.no_grad()
    def measure(net):
        near, far = losses(net, check, layout, CHECK, 0.0)
        return {"val": near.item(), "val_own": far.item()}

    for _ in loop:
        own = int(args.own * min(1.0, loop.progress / 0.6)) if loop.progress > 0.1 else 0
        window = data.sample(args.batch, FIRST + own + 1)
        with mixed(args.device):
            near, far = losses(net, window, layout, own)
        loop.update(near + args.own_weight * far, train=near, own=far)
        loop.report(50, measure, 200)
    loop.finish(measure)


def load(path):
    """The averaged network of a checkpoint, its layout, and the checkpoint."""
    state = common.load(path)
    layout = LAYOUTS[state["layout"]]
    net = nets.Dram(layout.size, state["features"], state["backbone"], state["sizes"], state["variant"])
    net.load_state_dict(state["ema"])
    return net.eval(), layout, state


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", required=True, help="folder of visavis_train.dram.data")
    parser.add_argument("--out", required=True, help="checkpoint; with --table a folder")
    parser.add_argument("--backbone", choices=SIZES, default="tcn")
    parser.add_argument("--variant", choices=nets.VARIANTS, default="dram")
    parser.add_argument("--layout", choices=LAYOUTS, default="whole", help="upper: the paper's twelve joints without translation")
    parser.add_argument("--own", type=int, default=20, help="longest roll-out in training, frames [20]")
    parser.add_argument("--own-weight", type=float, default=0.5)
    parser.add_argument("--init", help="checkpoint of the same sizes to start from")
    parser.add_argument("--table", action="store_true", help="trains every variant with both backbones, layout upper; what is there is kept")
    common.arguments(parser, steps=3000, lr=2e-3, batch=24)
    args = parser.parse_args()
    common.start_process(args)
    data, held = Split(args.data, "train"), Split(args.data, "val")
    if not args.table:
        return train(args, args.out, data, held)
    os.makedirs(args.out, exist_ok=True)
    folder, args.layout = args.out, "upper"
    for args.variant in reversed(nets.VARIANTS):
        for args.backbone in SIZES:
            out = os.path.join(folder, f"{args.variant}-{args.backbone}.pt")
            if not os.path.exists(out + ".done"):
                print(out, flush=True)
                train(args, out, data, held)
                open(out + ".done", "w").close()


if __name__ == "__main__":
    main()
