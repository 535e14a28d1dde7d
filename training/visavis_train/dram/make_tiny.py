"""Tiny bundles of kind `dram` for parity tests: random weights, real shapes.

    python -m visavis_train.dram.make_tiny --backbone tcn --out tests/goldens/dram-tcn.safetensors
"""
import argparse

import torch

from .. import bundle as bundles
from ..make_tiny import AUDIO, lively, sway
from ..motion import features, rig
from ..nets.audio import AudioEncoder
from . import bundle, pose
from .nets import Dram

SIZES = {"tcn": {"monadic": {"width": 24, "dilations": [1, 2, 4]}, "dyadic": {"width": 32, "dilations": [1, 2, 4, 8]}},
         "lstm": {"monadic": {"width": 24, "layers": 1}, "dyadic": {"width": 32, "layers": 2}}}
IDLE = 16


def build(kind, seed=1):
    torch.manual_seed(seed)
    p, q = features.from_features(sway(400).numpy())
    y = pose.from_world(p, rig.quat_to_mat(q))[0]
    layout = pose.Layout()
    net = Dram(layout.size, 8, kind, SIZES[kind])
    for part in (net.monadic, net.dyadic):
        lively(part, 0.7)
        with torch.no_grad():
            part.out.weight.mul_(0.5)
    net.mean.copy_(y.mean(0))
    net.std.copy_(torch.full_like(net.std, 0.3))
    net.std[:3] = torch.tensor([0.01, 0.01, 0.02])
    net.step.copy_(0.02 + 0.03 * torch.rand_like(net.step))
    audio = lively(AudioEncoder(AUDIO, 8), 1.6)
    tensors = {"idle.frames": y[1:1 + IDLE]} | bundles.net_tensors("audio", audio) | bundle.tensors_of(net)
    return tensors, bundle.config(bundles.rig_config(rig.NAMES, rig.PARENTS, rig.OFFSETS, rig.EYES, rig.HEAD_BACK), audio, kind, SIZES[kind],
                                  name=f"tiny-{kind}", description="Random weights for tests; its motion means nothing.", licence="Same as the code.")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--backbone", choices=SIZES, required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    bundles.write(args.out, *build(args.backbone, args.seed), half=True)


if __name__ == "__main__":
    main()
