"""Writes what a bundle of kind `mospa` computes, for parity tests of the runtime.

    python -m visavis_train.mospa.goldens --bundle B.safetensors --out G.safetensors

    sound [51200] i16, value / 32768; features [64, 132]: of one ear that hears it
    The ears of the rest hear its first 800 T samples; the right one at half the level, 12 samples late:
    left, right [T, 132]; location [3]; genre [1] i32; noise [T, D] f16; x0 [T, D]: of the noise at step 999, standardised
    motion [T, D]: four steps, metres; positions [T, J, 3], rotations [T, J, 4] (x, y, z, w) of it in the world
    blind [T, D]: the same without a location and a genre
"""
import argparse

import numpy as np
import torch
from safetensors.torch import save_file

from ..motion import rig
from . import bundle, diffusion, features, layout, nets


def sound(n, seed=3):
    """Clicks two and a half times a second over a chord that changes and a little noise, i16 [n]."""
    rng, t = np.random.default_rng(seed), np.arange(n) / features.RATE
    y = 0.02 * rng.standard_normal(n)
    for k, f in enumerate((220.0, 277.2, 329.6, 440.0)):
        y += 0.06 * np.sin(2 * np.pi * f * (1 if k % 2 else 1.06) ** (t > 1.2) * t) * (0.3 + 0.7 * (t > 0.3 * k))
    for at in range(3000, n - 2000, 9600):
        y[at:at + 2000] += 0.4 * np.exp(-np.arange(2000) / 300) * rng.standard_normal(2000)
    return np.round(np.clip(y, -1, 1) * 32767).astype(np.int16)


@torch.no_grad()
def compute(net):
    torch.manual_seed(7)
    i16, t = sound(51200), net.frames
    left = i16[:features.HOP * t] / 32768
    right = 0.5 * np.concatenate([np.zeros(12), left[:-12]])
    ears = [torch.from_numpy(features.ear(y)).float()[None] for y in (left, right)]
    place, genre, noise = torch.tensor([[1.5, 0.7, -2.0]]), torch.tensor([2]), torch.randn(1, t, layout.SIZE).half().float()
    heard, row = net.hear(*ears), nets.source_row(place, torch.ones(1))
    motion = net.unstandardise(diffusion.sample(net, noise, 4, heard, row, genre))[0]
    p, r = layout.to_world(motion.numpy())
    return {"sound": torch.from_numpy(i16), "features": torch.from_numpy(features.ear(i16 / 32768)).float(), "left": ears[0][0], "right": ears[1][0], "location": place[0],
            "genre": genre.int(), "noise": noise[0].half(), "x0": net(noise, torch.tensor([999]), heard, row, genre)[0], "motion": motion,
            "positions": torch.from_numpy(p).float(), "rotations": torch.from_numpy(rig.mat_to_quat(r)).float(),
            "blind": net.unstandardise(diffusion.sample(net, noise, 4, heard, 0 * row, torch.tensor([nets.UNKNOWN])))[0]}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--bundle", required=True)
    parser.add_argument("--out", required=True)
    args = parser.parse_args()
    save_file({k: v.contiguous() for k, v in compute(bundle.read(args.bundle)[0]).items()}, args.out)


if __name__ == "__main__":
    main()
