"""How quick a listener's hands are, by how long ago the agent spoke: do gestures outlast its phrases, or come while the user speaks?

    visavis eval --model B.safetensors --clips DIR --keep KEPT
    python -m visavis_train.train.listener --motion KEPT

Mean speed of both hands relative to the hips [m/s] (`corpus/measures.py`) in frames in which the user speaks and the agent does not, for each row that
was kept.
"""
import argparse
import os

import numpy as np

from ..corpus import measures, store
from ..corpus.attention import mask
from ..corpus.people import phrases
from ..motion import rig
from .tell import like, read

EDGES = (0.0, 1.0, 2.0, 4.0, np.inf)  # seconds since the agent spoke; before its first word it never did


def since(speech):
    """Seconds since the last True of [T] bool; infinite before the first."""
    last = np.maximum.accumulate(np.where(speech, np.arange(len(speech)), -1))
    return np.where(last < 0, np.inf, (np.arange(len(speech)) - last) / rig.FPS)


def parts(clip):
    """Masks [4, T] of the frames in which the user alone speaks, by EDGES."""
    agent, user = (mask(phrases(clip, who), len(clip.positions)) for who in ("agent", "user"))
    ago = since(agent)
    inner = (np.arange(len(ago)) > 0) & (np.arange(len(ago)) < len(ago) - 1)
    return np.stack([user & ~agent & inner & (ago >= a) & ((ago < b) | (b == np.inf)) for a, b in zip(EDGES, EDGES[1:])])


def speeds(clips, masks):
    """Mean hand speed in each of the masks' parts."""
    tracks = (measures.tracks(c.positions.astype(np.float64), rig.quat_to_mat(c.rotations))["hand_v"].mean(1) for c in clips)
    sums = np.sum([m @ v for v, m in zip(tracks, masks)], 0)
    return sums / np.maximum(np.sum([m.sum(1) for m in masks], 0), 1)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--motion", required=True, help="folder that visavis eval --keep wrote")
    args = parser.parse_args()
    corpus = read(args.motion, "corpus")
    masks = [parts(store.load(os.path.join(args.motion, "corpus", name))) for name in corpus]
    frames = np.sum([m.sum(1) for m in masks], 0)
    names = [f"{a:g} to {b:g} s" if b < np.inf else f"{a:g} s or longer" for a, b in zip(EDGES, EDGES[1:])]
    print("| row | " + " | ".join(f"{n} ago ({f / rig.FPS:.0f} s)" for n, f in zip(names, frames)) + " |\n" + "|---" * (len(names) + 1) + "|")
    for row in ["corpus"] + sorted(r for r in os.listdir(args.motion) if r != "corpus" and os.path.isdir(os.path.join(args.motion, r))):
        clips = like(corpus, read(args.motion, row), row)
        print(f"| {row} | " + " | ".join(f"{v:.2f}" for v in speeds(clips, masks)) + " |")


if __name__ == "__main__":
    main()
