"""Checkpoint -> bundle of kind `mospa` for the runtime.

    python -m visavis_train.mospa.export --corpus WORK/mospa/corpus --data DATA --net runs/mospa.pt --out B.safetensors [--half]

The licence names whose recordings the clips of `train` were made from; each of ESC-10's by its maker, from DATA/sounds/esc10/ATTRIBUTION.tsv.
"""
import argparse
import json
import os

from .. import bundle as bundles
from .. import credits
from . import bundle, train

DESCRIPTION = ("Reactions to sounds around a standing person, 8 s at a time, after MOSPA: diffusion transformer. Trained on a simulated corpus: sounds rendered "
               "binaurally, motion composed from real clips by class and sensitivity (no captured reactions).")


def licence(corpus, data):
    """Acknowledgements of what the clips name."""
    with open(os.path.join(corpus, "train", "clips.json")) as f:
        clips = json.load(f)
    return credits.statement({n for c in clips for n in c["motion"]} | {c["sound"] for c in clips} | {"music/"}, data)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--data", required=True)
    parser.add_argument("--net", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--name", default="mospa")
    parser.add_argument("--half", action="store_true", help="f16 instead of f32")
    args = parser.parse_args()
    net, state = train.load(args.net)
    settings = bundle.config(state["sizes"], name=args.name, description=DESCRIPTION, licence=licence(args.corpus, args.data))
    bundles.write(args.out, bundle.tensors_of(net), settings, half=args.half)
    print(f"{args.out}: {os.path.getsize(args.out) / 1e6:.1f} MB, step {state['step']}")


if __name__ == "__main__":
    main()
