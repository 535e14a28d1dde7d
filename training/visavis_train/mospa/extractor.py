"""What the table is measured with: the paper's feature extractor (its appendix B.2, smaller), and a classifier of reactions.

    python -m visavis_train.mospa.extractor --corpus WORK/mospa/corpus --out runs/extractor.pt --steps 600

A motion autoencoder (transformers), a bidirectional GRU on what it gives back, another on the projected features with place and sensitivity; contrastive loss with a margin of
10 between them. For the last third of the steps the autoencoder rests. A third GRU on the motion tells the reaction. Patches of eight frames are one step.
"""
import argparse

import torch
import torch.nn.functional as F
from torch import nn

from ..nets.layers import Layer
from ..train import common
from ..train.common import mixed
from ..train.loop import Loop
from ..train.team import Team
from . import features, layout, nets, react
from .data import Split

PATCH, WIDTH, HIDDEN, OUT, MARGIN = 8, 64, 64, 48, 10.0
AWAKE = 2 / 3                                  # of the steps in which the autoencoder learns


def stack(width, layers, heads=4):
    out = nn.ModuleList(Layer(width, heads, 2) for _ in range(layers))
    for layer in out:
        layer.attn = nets.Full(width, heads)
    return out


class Gru(nn.Module):
    """Bidirectional; the means of its states over time, projected."""

    def __init__(self, inputs, outputs, layers=1):
        super().__init__()
        self.gru, self.out = nn.GRU(inputs, HIDDEN, layers, batch_first=True, bidirectional=True), nn.Linear(2 * HIDDEN, outputs)

    def forward(self, x):
        return self.out(self.gru(x)[0].mean(1))


class Extractor(nn.Module):
    def __init__(self):
        super().__init__()
        size = PATCH * layout.SIZE
        self.into, self.encoder, self.decoder, self.back = nn.Linear(size, WIDTH), stack(WIDTH, 2), stack(WIDTH, 2), nn.Linear(WIDTH, size)
        self.motion, self.condition = Gru(size, OUT), Gru(WIDTH + 8, OUT)
        self.audio = nn.Linear(PATCH * 2 * features.SIZE, WIDTH)
        self.tell = Gru(size, len(react.REACTIONS))
        self.standard = nets.Mospa(react.FRAMES, PATCH, 8, 1, 0, 1)      # the corpus' statistics, and how inputs are standardised
        self.standard.requires_grad_(False)

    def patches(self, x):
        return x.reshape(len(x), -1, PATCH * x.shape[-1])

    def rebuild(self, x):
        h = self.into(x) + nets.wave(torch.arange(x.shape[1]), WIDTH)
        for layer in (*self.encoder, *self.decoder):
            h = layer(h, None)
        return self.back(h)

    def of_motion(self, x):
        """Features [B, 48] of motion [B, T, D] in metres."""
        return self.motion(self.rebuild(self.patches(self.standard.standardise(x))))

    def of_condition(self, heard, row, genre):
        h = self.audio(self.patches(heard))
        beside = torch.cat([row, F.one_hot(genre, nets.UNKNOWN)], -1)[:, None].expand(-1, h.shape[1], -1)
        return self.condition(torch.cat([h, beside], -1))

    def reactions(self, x):
        """Logits [B, 7] of the reactions of motion [B, T, D] in metres."""
        return self.tell(self.patches(self.standard.standardise(x)))


def losses(net, split, which, asleep):
    x = torch.from_numpy(split.poses(which))
    flat = net.patches(net.standard.standardise(x))
    with torch.set_grad_enabled(not asleep and torch.is_grad_enabled()):
        again = net.rebuild(flat)
    m, c = net.motion(again), net.of_condition(*split.given(net.standard, which))
    apart = torch.cdist(c.float(), m.float())
    same = torch.eye(len(x), dtype=torch.bool)
    contrast = apart[same].square().mean() + (MARGIN - apart[~same]).clamp(min=0).square().mean()
    told = net.reactions(x).float()
    wanted = torch.from_numpy(split.reaction[[i % len(split) for i in which]])
    return (again.float() - flat).square().mean() * (0 if asleep else 1), contrast, F.cross_entropy(told, wanted), (told.argmax(-1) == wanted).float().mean()


def load(path):
    net = Extractor()
    net.load_state_dict(common.load(path)["ema"])
    return net.eval()


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--out", required=True)
    common.arguments(parser, steps=600, lr=2e-3, batch=32)
    args = parser.parse_args()
    common.start_process(args)
    team, data, held = Team(1), Split(args.corpus, "train"), Split(args.corpus, "val")
    net = Extractor()
    for name, value in data.statistics().items():
        getattr(net.standard, name).copy_(value)
    loop = Loop(team, net, args, warmup=50, average=0.99)

    @torch.no_grad()
    def measure(net):
        again, contrast, told, right = losses(net, held, list(range(min(96, len(held)))), False)
        return {"val_rebuilt": again.item(), "val_contrast": contrast.item(), "val_right": right.item()}

    for _ in loop:
        which = torch.randint(2 * len(data), (args.batch,)).tolist()
        with mixed(args.device):
            again, contrast, told, right = losses(net, data, which, loop.progress > AWAKE)
        loop.update(again + 0.05 * contrast + told, rebuilt=again, contrast=contrast, right=right)
        loop.report(50, measure, 200)
    loop.finish(measure)


if __name__ == "__main__":
    main()
