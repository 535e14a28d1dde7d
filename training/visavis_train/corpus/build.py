"""Builds the corpus: loads the real parts of each split, simulates the conversations and writes the clips."""
import os
import shutil
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from ..motion import bvh
from . import converse, gestures, partner, plausible, real, rest, simulate, store, voices

SPLITS = ("train", "val", "test")
RETRIES = 8


def load_sources(data, split):
    """Everything simulated clips of `split` may draw on, from the shared data folder."""
    speech = os.path.join(data, "speech")
    skeleton = bvh.read_bvh(os.path.join(data, "motion", "cmu_walk", "02_01.bvh")).skeleton
    spots, motifs = gestures.real_shapes(real.signal_takes(data, split, skeleton))
    return simulate.Sources(voices.load_voices(speech, split), voices.load_pair(speech) if split == "test" else None,
                            real.head_paths(data, split), spots, motifs, rest.load(data, split), converse.load(data, split), real.swing_library(data, split))


def split_hours(hours):
    """Simulated hours of each split: `hours` of training, 5 % (at least a quarter of an hour) of validation and test each."""
    small = max(0.25, 0.05 * hours)
    return {"train": hours, "val": small, "test": small}


def clip_lengths(seed, s, hours):
    """Frames of each simulated clip of split `s`: 1 to 2 minutes until `hours` are full."""
    rng, left, out = np.random.default_rng([seed, s, 3]), int(hours * 3600 * 30), []
    while left > 0:
        out.append(int(rng.uniform(60, 120) * 30) // 4 * 4)
        left -= out[-1]
    return out


def talk(rng_key, frames, src, *fixed):
    """One plausible conversation and the reasons of the draws thrown away before it; `fixed` as for `simulate_clip`."""
    rejected = []
    for attempt in range(RETRIES):
        clip = simulate.simulate_clip(np.random.default_rng([*rng_key, attempt]), frames, src, *fixed)
        reasons = plausible.faults(clip.positions, clip.rotations, plausible.SIMULATED)
        if not reasons:
            return clip, rejected
        rejected += reasons
    raise RuntimeError(f"conversation {rng_key}: no plausible draw in {RETRIES}: {', '.join(sorted(set(rejected)))}")


_sources = None


def _start(data, split):
    """A worker's own copy of the sources."""
    global _sources
    _sources = load_sources(data, split)


def _write_talk(job):
    folder, seed, s, i, frames = job
    # every eighth clip is silent; multiples of irrational numbers spread gaze levels and recordings at rest evenly
    silent = i % 8 == 3
    person = (0.5 + (i // 8 if silent else i) * 0.7548776662) % 1.0
    clip, rejected = talk((seed, s, 2, i), frames, _sources, (0.35 + i * 0.6180339887) % 1.0, person, silent)
    place = f"{seed}/{s}/{i}"
    seen, positions, rotations, nods = partner.perform(partner.seeded(place), clip.positions, clip.rotations, clip.user, clip.agent_phrases,
                                                       clip.user_phrases)
    store.save(os.path.join(folder, f"talk_{i:05d}.safetensors"), positions, rotations, clip.user, clip.agent_voice, clip.user_voice,
               {"split": SPLITS[s], "sources": clip.sources, "gaze_level": f"{clip.level.mean():.4f}", "seed": place, "kind": "talk",
                "agent_phrases": _seconds(clip.agent_phrases), "user_phrases": _seconds(clip.user_phrases), "joins": clip.joins,
                "user_nods": nods}, seen)
    return rejected


def _seconds(phrases):
    return [[round(float(a), 3), round(float(b), 3)] for a, b in phrases]


def _real_clips(data, folder, split, seed, s):
    """Writes the two-person takes, the chained walks and the people at rest; returns the reasons of what was left out."""
    left_out = []
    for name, p, r, u, seen in real.two_person(data, split):
        meta = {"split": split, "sources": ["cmu_two_person/" + name], "gaze_level": "nan", "seed": str(seed), "kind": "pair"}
        left_out += _keep(os.path.join(folder, f"pair_{name}.safetensors"), p, r, u, meta, seen)
    for name, p, r, u, parts in real.walks(data, split, np.random.default_rng([seed, s, 1])):
        meta = {"split": split, "sources": parts, "gaze_level": "nan", "seed": str(seed), "kind": "walk"}
        left_out += _keep(os.path.join(folder, f"walk_{name}.safetensors"), p, r, u, meta)
    for name, p, r, u in real.idles(data, split, np.random.default_rng([seed, s, 4])):
        meta = {"split": split, "sources": [name], "gaze_level": "nan", "seed": str(seed), "kind": "idle"}
        left_out += _keep(os.path.join(folder, f"idle_{name}.safetensors"), p, r, u, meta)
    return left_out


def _keep(path, p, r, u, meta, seen=None):
    reasons = plausible.faults(p, r, plausible.CAPTURED)
    if not reasons:
        store.save(path, p, r, u, None, None, meta, seen)
    return reasons


def build(data, out, hours, seed=0, log=print, workers=1):
    """Writes OUT/{train,val,test}/*.safetensors; deterministic from `seed`, whatever the number of `workers` (processes).

    Built beside OUT and moved there when complete. Every clip has passed `plausible.faults`."""
    tmp = out.rstrip("/") + ".partial"
    shutil.rmtree(tmp, ignore_errors=True)
    for s, split in enumerate(SPLITS):
        folder = os.path.join(tmp, split)
        os.makedirs(folder)
        left_out = _real_clips(data, folder, split, seed, s)
        jobs = [(folder, seed, s, i, n) for i, n in enumerate(clip_lengths(seed, s, split_hours(hours)[split]))]
        with ProcessPoolExecutor(workers, get_context("spawn"), _start, (data, split)) as pool:
            rejected = [r for reasons in pool.map(_write_talk, jobs, chunksize=4) for r in reasons]
        log(f"{split}: {len(jobs)} conversations; drawn again: {counts(rejected)}; captured clips left out: {counts(left_out)}")
    old = out.rstrip("/") + ".old"
    shutil.rmtree(old, ignore_errors=True)
    if os.path.exists(out):
        os.rename(out, old)
    os.rename(tmp, out)
    shutil.rmtree(old, ignore_errors=True)


def counts(reasons):
    return ", ".join(f"{reasons.count(r)} {r}" for r in sorted(set(reasons))) or "none"
