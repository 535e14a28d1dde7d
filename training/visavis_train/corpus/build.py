"""Builds the corpus: loads the real parts of each split, simulates the conversations and writes the clips."""
import os
import shutil

import numpy as np

from ..motion import bvh
from . import gestures, real, simulate, store, voices

SPLITS = ("train", "val", "test")


def load_sources(data, split):
    """Everything simulated clips of `split` may draw on, from the shared data folder."""
    speech = os.path.join(data, "speech")
    skeleton = bvh.read_bvh(os.path.join(data, "motion", "cmu_walk", "02_01.bvh")).skeleton
    spots, motifs = gestures.real_shapes(real.signal_takes(data, split, skeleton))
    return simulate.Sources(voices.load_voices(speech, split), voices.load_pair(speech) if split == "test" else None,
                            real.head_paths(data, split), spots, motifs)


def split_hours(hours):
    """Simulated hours of each split: `hours` of training, 5 % (at least a quarter of an hour) of validation and test each."""
    small = max(0.25, 0.05 * hours)
    return {"train": hours, "val": small, "test": small}


def build(data, out, hours, seed=0, log=print):
    """Writes OUT/{train,val,test}/*.safetensors; deterministic from `seed`. Built beside OUT and moved there when complete."""
    tmp = out.rstrip("/") + ".partial"
    shutil.rmtree(tmp, ignore_errors=True)
    for s, split in enumerate(SPLITS):
        folder = os.path.join(tmp, split)
        os.makedirs(folder)
        for name, p, r, u in real.two_person(data, split):
            store.save(os.path.join(folder, f"pair_{name}.safetensors"), p, r, u, None, None,
                       {"split": split, "sources": ["cmu_two_person/" + name], "gaze_level": "nan", "seed": str(seed), "kind": "pair"})
        for name, p, r, u, parts in real.walks(data, split, np.random.default_rng([seed, s, 1])):
            store.save(os.path.join(folder, f"walk_{name}.safetensors"), p, r, u, None, None,
                       {"split": split, "sources": parts, "gaze_level": "nan", "seed": str(seed), "kind": "walk"})
        src = load_sources(data, split)
        left, i = int(split_hours(hours)[split] * 3600 * 30), 0
        while left > 0:
            rng = np.random.default_rng([seed, s, 2, i])
            frames = int(rng.uniform(60, 120) * 30) // 4 * 4
            clip = simulate.simulate_clip(rng, frames, src, (0.35 + i * 0.6180339887) % 1.0)  # golden ratio: levels spread evenly
            store.save(os.path.join(folder, f"talk_{i:05d}.safetensors"), clip.positions, clip.rotations, clip.user,
                       clip.agent_voice, clip.user_voice,
                       {"split": split, "sources": clip.sources, "gaze_level": f"{clip.level.mean():.4f}",
                        "seed": f"{seed}/{s}/{i}", "kind": "talk"})
            left -= frames
            i += 1
        log(f"{split}: {i} conversations")
    old = out.rstrip("/") + ".old"
    shutil.rmtree(old, ignore_errors=True)
    if os.path.exists(out):
        os.rename(out, old)
    os.rename(tmp, out)
    shutil.rmtree(old, ignore_errors=True)
