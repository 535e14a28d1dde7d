"""Makes a flow twice as wide, and deeper, that does what the narrow one does (Net2Net, Chen et al. 2016), to be trained on.

    python -m visavis_train.train.grow --flow runs/flow.pt --layers 6 --out runs/wide.pt

Every unit of the residual stream, head and hidden unit of the MLP is there twice: norms over doubled units have the same mean and variance. What reads
a pair takes a random share of its weight from each, so that the gradients of the two differ. New layers have closed gates (AdaLN-Zero).
"""
import argparse

import torch

from ..nets.flow import FlowNet
from . import common
from .flow import described, load_flow


def twice(weight, parts=1):
    """The rows of each of `parts` equal parts of a weight or bias, doubled."""
    return torch.cat([torch.cat([p, p]) for p in weight.chunk(parts)])


def shared(weight):
    """Columns that read doubled inputs: a random share of each weight reads the one, the rest the other."""
    share = torch.rand_like(weight)
    return torch.cat([share * weight, (1 - share) * weight], 1)


@torch.no_grad()
def grow(net, size, layers):
    """A network of doubled width and heads and of `layers` layers with the function of `net`, and its sizes; `size` are those of `net`."""
    if layers < size["layers"]:
        raise SystemExit(f"the flow has {size['layers']} layers: --layers must be at least that")
    wide = size | {"width": 2 * size["width"], "heads": 2 * size["heads"], "layers": layers}
    old = net.state_dict()
    new = FlowNet(old["embed_latent.weight"].shape[1], old["embed_agent.weight"].shape[1] // 4, **wide, sound_features=net.sound_features)
    weights = new.state_dict()  # of new layers what they begin with
    parts = {"qkv": 3, "mod": 6, "final.mod": 2}
    for name, value in old.items():
        kind = next((k for k in ("final.mod", "final.out", "qkv", "proj", "fc1", "fc2", "mod", "input", "input_sound") if f"{k}." in name), None)
        if kind and kind != "final.out":
            value = twice(value, parts.get(kind, 1))
        if kind in ("final.out", "qkv", "proj", "fc1", "fc2") and name.endswith("weight"):
            value = shared(value)
        weights[name] = value
    new.load_state_dict(weights)
    return new, wide


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--flow", required=True, help="checkpoint of the narrow flow")
    parser.add_argument("--layers", type=int, default=6, help="of the new one [6]")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", required=True)
    args = parser.parse_args()
    torch.manual_seed(args.seed)
    net, state = load_flow(args.flow)
    wide, size = grow(net, state["size"], args.layers)
    weights = wide.state_dict()
    common.save(args.out, net=weights, ema=weights, step=0, **described(state) | {"size": size})
    print(f"{args.out}: {sum(v.numel() for v in weights.values()) / 1e6:.1f} M weights, {size}")


if __name__ == "__main__":
    main()
