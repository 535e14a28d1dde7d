"""Trains the encoder of what is heard in the room: spectrum and prosody of each frame, as the voices' (`train.audio`), and the class of the sound.

    python -m visavis_train.hearing.encoder --data DATA --out runs/hearing.pt --steps 1500
"""
import argparse

import numpy as np
import torch
from torch import nn

from ..mospa import sounds
from ..nets.audio import FRAME_SAMPLES, AudioEncoder
from ..train import common
from ..train.audio import BANDS, standardise, targets
from ..train.common import mixed
from ..train.loop import Loop
from ..train.sizes import convolutions
from ..train.team import Team
from . import ears
from .variety import varied

CHANNELS, FEATURES = (16, 32, 48, 64, 96, 96, 96), 32
SILENCE = sounds.CLASSES.index("silence")
LATE = 3        # frames of a sound before its class can be told


class Batches:
    """Cuts of a sound that begins somewhere in them, at the levels of 1 to 5 m, on a quiet ground. `vary`: as other recordings of its class might be
    (`variety`), over another one at times."""

    def __init__(self, heard, frames, seed=0, vary=False):
        self.heard, self.frames, self.rng, self.vary = heard, frames, np.random.default_rng(seed), vary

    def _sound(self, kind):
        y, _ = self.heard.draw(self.rng, kind)
        y = y * 10 ** ((sounds.LEVEL[kind] + self.rng.uniform(-6, 6) - 94) / 20) / self.rng.uniform(1, 5)
        first = int(self.rng.integers(0, max(1, len(y) - 12 * FRAME_SAMPLES))) if self.rng.random() < 0.4 else 0
        y = y[first:first + 2 * self.frames * FRAME_SAMPLES]
        return varied(self.rng, y) if self.vary else y

    def batch(self, size):
        """Squashed waves [B, 800 T], classes [B, T], and how much each frame's counts [B, T]."""
        n = self.frames * FRAME_SAMPLES
        waves, kinds, weights = np.zeros((size, n)), np.full((size, self.frames), SILENCE), np.ones((size, self.frames))
        for i in range(size):
            if self.rng.random() < 0.95:
                kind = int(self.rng.integers(SILENCE))     # silence is the last class
                y, first = self._sound(sounds.CLASSES[kind]), int(self.rng.integers(0, self.frames // 2))
                y = y[:n - first * FRAME_SAMPLES]
                waves[i, first * FRAME_SAMPLES:first * FRAME_SAMPLES + len(y)] = y
                if self.vary and self.rng.random() < 0.3:
                    other = self._sound(sounds.CLASSES[int(self.rng.integers(SILENCE))])[:n]
                    waves[i, :len(other)] += other * self.rng.uniform(0.05, 0.25) * np.sqrt((np.square(y).mean() + 1e-12) / (np.square(other).mean() + 1e-12))
                last = first + -(-len(y) // FRAME_SAMPLES)
                kinds[i, first:last] = kind
                weights[i, first:first + LATE] = 0
                loud = ears.decibels(waves[i]) > 40
                weights[i, first:last] *= loud[first:last]
            waves[i] += 10 ** (self.rng.uniform(-86, -60) / 20) * self.rng.standard_normal(n)
        return [torch.tensor(a) for a in ((waves / (ears.SQUASH + np.abs(waves))).astype(np.float32), kinds, weights.astype(np.float32))]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", required=True, help="folder with sounds/ and speech/")
    parser.add_argument("--out", required=True)
    parser.add_argument("--frames", type=int, default=45)
    parser.add_argument("--init", help="checkpoint of an encoder to go on from, say a bundle's (`visavis_train.checkpoints`)")
    common.arguments(parser, steps=1500, lr=2e-3, batch=24)
    args = parser.parse_args()
    common.start_process(args)
    team = Team(args.workers)
    train, held = (Batches(sounds.Sounds(args.data, split), args.frames, seed, split == "train") for split, seed in (("train", args.seed), ("val", 1)))
    check, kinds, counts = held.batch(192)
    net = AudioEncoder(convolutions(*CHANNELS), FEATURES)
    if args.init:
        net.load_state_dict(common.load(args.init)["ema"])
    heads = nn.ModuleList([nn.Linear(FEATURES, 2 * BANDS + 4), nn.Linear(FEATURES, len(sounds.CLASSES))])
    loop = Loop(team, net, args, warmup=100, average=0.995, beside={"heads": heads}, spec=net.spec, features=FEATURES)

    @torch.no_grad()
    def measure(net):
        y, heads = net(check), loop.averages["heads"].net
        right = (heads[1](y).argmax(-1) == kinds).float()
        return {"val": (heads[0](y) - targets(check)).square().mean().item(), "right": ((right * counts).sum() / counts.sum()).item()}

    for _ in loop:
        wave, kind, count = train.batch(args.batch)
        with mixed(args.device):
            y = net(wave).float()
        error = (heads[0](y) - targets(wave)).square().mean()
        told = (nn.functional.cross_entropy(heads[1](y).flatten(0, 1), kind.flatten(), reduction="none") * count.flatten()).sum() / count.sum()
        loop.update(0.5 * error + told, train=error, told=told)
        loop.report(50, measure)
    standardise(loop.ema.net, torch.cat([train.batch(64)[0], check]))
    loop.finish()


if __name__ == "__main__":
    main()
