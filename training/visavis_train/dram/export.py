"""Checkpoint -> bundle of kind `dram` for the runtime.

    python -m visavis_train.dram.export --corpus DIR --audio runs/audio.pt --net runs/dram-tcn.pt --out B.safetensors [--half]

Averaged weights are written. The idle clip is chosen as for the flow model's bundle (`visavis_train.export`).
"""
import argparse
import os

import torch

from .. import bundle as bundles
from .. import credits
from ..export import idle_clip
from ..motion import features, rig
from ..train.cache import load_audio
from . import bundle, pose, train

DESCRIPTION = ("Featherweight conversation motion (dyadic residual attention): deterministic, with a weight of the reaction to the user for every joint. Trained on a "
               "corpus simulated from real clips and real speech (no captured conversations).")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--audio", required=True)
    parser.add_argument("--net", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--name", default="dram")
    parser.add_argument("--idle-from", metavar="BUNDLE", help="take the idle clip of a bundle of the flow model")
    parser.add_argument("--idle-frames", type=int, default=64)
    parser.add_argument("--half", action="store_true", help="f16 instead of f32")
    args = parser.parse_args()
    torch.set_num_threads(1)
    net, layout, state = train.load(args.net)
    if layout != pose.Layout() or state["variant"] != "dram":
        raise SystemExit(f"{args.net} is {state['variant']} of layout {state['layout']}; bundles hold dram of the whole body")
    if args.idle_from:
        idle, where = bundles.read(args.idle_from).idle(), args.idle_from
    else:
        idle, where = idle_clip(args.corpus, "train", args.idle_frames)
    if idle is None:
        raise SystemExit(f"no clips of conversations or people at rest under {args.corpus}/train")
    p, q = features.from_features(idle.numpy())
    y = pose.from_world(p, rig.quat_to_mat(q))[0]
    y[0, :3] = idle[0, :3]
    audio = load_audio(args.audio)
    tensors = {"idle.frames": y} | bundles.net_tensors("audio", audio) | bundle.tensors_of(net)
    config = bundle.config(bundles.rig_config(rig.NAMES, rig.PARENTS, rig.OFFSETS, rig.EYES, rig.HEAD_BACK), audio, state["backbone"], state["sizes"],
                           name=args.name, description=DESCRIPTION, licence=credits.licence(args.corpus))
    bundles.write(args.out, tensors, config, half=args.half)
    print(f"{args.out}: {os.path.getsize(args.out) / 1e6:.1f} MB, {state['backbone']}, step {state['step']}, idle clip from {where}")


if __name__ == "__main__":
    main()
