"""How well a small convolutional net tells generated motion from a corpus' motion: windows of 2 s, as many of each.

    python -m visavis_train.train.tell --bundle B.safetensors --corpus DIR [--split test] [--clips 24] [--seconds 53] [--rows vae flow:0.75 student:0.75]

For each row (named as in `train.stillness`; `other`: the corpus' motion of another clip of the same half, real motion that cannot be told) a net is trained on one half
of the clips and judged on the other, then the other way round, each with `--nets` seeds. It sees joint positions in the heading frame, their velocities and
the root's step. Printed: accuracy on windows it was not trained on, its standard error by the jackknife over clips, and accuracy in windows in
which the corpus' hands are still. 0.5 is chance, 1 is always told.
"""
import argparse

import torch
from torch import nn

from .. import bundle as bundles
from ..corpus import measures
from ..motion import rig
from .geometry import local_positions, to_world
from .stillness import SETTLE, Judge, jackknife

FRAMES = 60    # of a window: 2 s
STRIDE = 15    # between the starts of windows
ROWS = ("other", "vae", "flow:0.75", "flow:1:1", "student:0.75")


def seen(x):
    """Features [..., T, F] in metres -> what the net sees [..., T - 1, 6 J + 3], in units of about one."""
    p = local_positions(x)
    return torch.cat([p[..., 1:, :, :].flatten(-2), (20 * p.diff(dim=-3)).flatten(-2), 30 * x[..., 1:, :3]], -1)


def windows(x):
    """Clips [N, T, C] -> windows [N, W, FRAMES, C]."""
    return x.unfold(1, FRAMES, STRIDE).transpose(2, 3)


class Net(nn.Module):
    """A window [B, T, C] -> the logit of its being generated."""

    def __init__(self, inputs, width=48):
        super().__init__()
        step = lambda i: [nn.Conv1d(i, width, 5, stride=2), nn.SiLU(), nn.Dropout(0.2)]
        self.layers = nn.Sequential(*step(inputs), *step(width), *step(width))
        self.out = nn.Linear(2 * width, 1)

    def forward(self, x):
        h = self.layers(x.transpose(1, 2))
        return self.out(torch.cat([h.mean(2), h.amax(2)], 1))[:, 0]


def train(real, made, steps, seed, batch=64, lr=2e-3):
    """A net trained on windows [N, T, C] of both kinds, and what standardises them."""
    torch.manual_seed(seed)
    both = torch.cat([real, made])
    mean, std = both.mean((0, 1)), both.std((0, 1)).clamp(min=1e-4)
    net = Net(real.shape[2]).train()
    optim = torch.optim.AdamW(net.parameters(), lr=lr, weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optim, steps)
    truth = torch.cat([torch.zeros(batch // 2), torch.ones(batch // 2)])
    for _ in range(steps):
        x = torch.cat([k[torch.randint(0, len(k), (batch // 2,))] for k in (real, made)])
        loss = nn.functional.binary_cross_entropy_with_logits(net((x - mean) / std), truth)
        optim.zero_grad()
        loss.backward()
        optim.step()
        schedule.step()
    net.eval()
    return lambda x: net((x - mean) / std)


def told(real, made, steps=600, nets=2, seed=0):
    """Shares of windows [N clips, W] that are told right, by nets that were trained on the clips of the other half; real and generated
    windows [N, W, T, C] of the same clips count alike. Mean over `nets`."""
    half, right = torch.arange(len(real)) % 2, torch.zeros(real.shape[:2])
    for side in (0, 1):
        for n in range(nets):
            net = train(*(k[half != side].flatten(0, 1) for k in (real, made)), steps, seed + n)
            with torch.no_grad():
                score = lambda k: net(k[half == side].flatten(0, 1)).unflatten(0, (-1, real.shape[1]))
                right[half == side] += ((score(real) < 0).float() + (score(made) >= 0).float()) / (2 * nets)
    return right


def resting(x, roots):
    """Windows [N, W] bool of features [N, T, F] at roots [N, T, 3] in which both hands are still for most of the time."""
    still = []
    for frames, root in zip(x, roots.double()):
        p = to_world(root, local_positions(frames).double()).numpy()
        t = measures.tracks(p, rig.axis_mat("y", root[:, 2].numpy())[:, None])
        still.append(torch.from_numpy((t["hand_v"] < measures.STILL).all(1)[1:]))
    return windows(torch.stack(still)[..., None].float())[..., 0].mean(-1) > 0.75


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--bundle", required=True)
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--split", default="test")
    parser.add_argument("--clips", type=int, default=24)
    parser.add_argument("--seconds", type=float, default=53)
    parser.add_argument("--rows", nargs="+", default=ROWS)
    parser.add_argument("--steps", type=int, default=600)
    parser.add_argument("--nets", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    judge = Judge(bundles.read(args.bundle), args.corpus, args.split, args.clips, round(args.seconds * rig.FPS / 4), seed=args.seed)
    corpus, roots = judge.make("corpus")
    real, rest = windows(seen(corpus[:, SETTLE:])), resting(corpus[:, SETTLE:], roots[:, SETTLE:])
    print(f"{len(corpus)} clips, {real.shape[1]} windows of each kind in each\n\n| row | told apart | at rest |\n|---|---|---|")
    for name in args.rows:
        x = corpus.roll(2, 0) if name == "other" else judge.make(name)[0]
        right = told(real, windows(seen(x[:, SETTLE:].float())), args.steps, args.nets, args.seed)
        cells = (jackknife((right * m).sum(1), m.sum(1)) for m in (torch.ones_like(right), rest.float()))
        print(f"| {name} | " + " | ".join(f"{v:.3f} ± {e:.3f}" for v, e in cells) + " |", flush=True)


if __name__ == "__main__":
    main()
