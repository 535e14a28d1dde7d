"""Blocks of four frames as coordinates along their principal directions: what stands in for the VAE where there is none.

    python -m visavis_train.rivals.directions --corpus DIR --out runs/rivals/directions.pt

The directions are those of frames weighted as in the VAE's loss, each of unit variance. Nothing is trained; what the directions leave out is printed.
"""
import argparse

import torch

from ..nets.vae import BLOCK, Affine
from ..train import common
from ..train.data import Motions, statistics
from ..train.vae import channel_weights, evaluate

COUNT = 192     # frames are then met within half a millimetre, hands within one


@torch.no_grad()
def fit(x, weights, count):
    """An `Affine` for standardised frames [N, 4 K, F] of channels that weigh `weights` [F]."""
    scale = weights.sqrt().repeat(BLOCK)
    v = x.unflatten(1, (-1, BLOCK)).flatten(2).flatten(0, 1) * scale
    middle = v.mean(0)
    variance, axes = torch.linalg.eigh((v - middle).T @ (v - middle) / len(v))
    variance, axes = variance.flip(0)[:count].clamp(min=1e-6), axes.flip(1)[:, :count]
    net = Affine(x.shape[-1], count)
    net.encoder.mu.weight.copy_((axes / variance.sqrt()).T * scale)
    net.encoder.mu.bias.copy_(-(axes / variance.sqrt()).T @ middle)
    net.decoder.out.weight.copy_(axes * variance.sqrt() / scale[:, None])
    net.decoder.out.bias.copy_(middle / scale)
    return net.eval()


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--count", type=int, default=COUNT)
    parser.add_argument("--windows", type=int, default=400, help="of 64 frames each, that the directions are of")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    torch.manual_seed(args.seed)
    train, held = Motions(args.corpus, "train"), Motions(args.corpus, "val")
    mean, std, _ = statistics(train)
    net = fit((train.sample(args.windows, 64) - mean) / std, channel_weights(len(mean)), args.count)
    print({k: round(v, 2) for k, v in evaluate(net, ((held if held.size else train).sample(48, 128) - mean) / std, mean, std).items()})
    common.save(args.out, ema=net.state_dict(), size={"directions": args.count}, form="icosahedra", mean=mean, std=std)


if __name__ == "__main__":
    main()
