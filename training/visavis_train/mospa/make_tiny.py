"""The tiny bundle of kind `mospa` for parity tests: random weights, real shapes.

    python -m visavis_train.mospa.make_tiny --out tests/goldens/mospa.safetensors
"""
import argparse

import torch

from .. import bundle as bundles
from ..make_tiny import lively, sway
from ..motion import features as poses
from ..motion import rig
from . import bundle, layout, nets

SIZES = {"frames": 16, "patch": 2, "width": 16, "heads": 2, "layers": 2, "mlp": 2, "diffusion_steps": 1000, "steps": 4}


def build(seed=1):
    torch.manual_seed(seed)
    p, q = poses.from_features(sway(400).numpy())
    x = torch.from_numpy(layout.from_world(p, rig.quat_to_mat(q)))
    net = lively(nets.Mospa(**SIZES))
    with torch.no_grad():
        for layer in net.layers:      # or tokens would hardly hear each other
            layer.attn.qkv.weight.mul_(2.0)
            layer.attn.proj.weight.mul_(2.5)
        net.out.weight.mul_(0.5)
    net.motion_mean.copy_(x.mean(0))
    net.motion_std.copy_(x.std(0).clamp(min=0.02))
    net.feature_mean.copy_(torch.cat([torch.tensor([-300.0]), torch.zeros(39), torch.full((92,), 0.3)]))
    net.feature_std.copy_(torch.cat([torch.full((20,), 30.0), torch.full((20,), 4.0), torch.full((92,), 0.4)]))
    return bundle.tensors_of(net), bundle.config(SIZES, name="tiny-mospa", description="Random weights for tests; its motion means nothing.", licence="Same as the code.")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", required=True)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    bundles.write(args.out, *build(args.seed), half=True)


if __name__ == "__main__":
    main()
