"""Conversations that sounds interrupt: clips as those of `visavis_train.corpus`, and beside each what the agent heard in the room.

    python -m visavis_train.hearing.corpus --data DATA --out WORK/hearing [--hours 6] [--workers 2]

Writes OUT/{train,val,test}/hear_N.safetensors (the format of `corpus/store.py`; `events` in the metadata) and hear_N.npz: `wave` i16 [800 T], what the
encoder hears (`ears.squashed`), `levels` [T, 2], `place` [T, 3], `known` [T], `reacts` [T] bool, `sensitivity`. Needs `soundfile`, and fluidsynth for music.
"""
import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from ..corpus import build, partner, plausible, real, rest, simulate, store
from ..mospa import sounds
from ..mospa.react import GENRES
from . import ears
from .events import Room

SHARES = {"train": 1.0, "val": 0.06, "test": 0.10}     # of --hours
STARTLED = plausible.Limits(speed=9.0, accel=230.0, toe=-0.01, trunk=0.08, trunk_share=0.03)     # arms that fly up, legs that hurry away
EVENT = ("kind", "reaction", "name", "onset", "end", "begin", "until", "moved")
_made = {}


def sources(data, split):
    """What clips of a split may draw on: the conversations' sources, sounds, layers of dances."""
    if split not in _made:
        _made.clear()
        dances = []
        for name, p, r, _, _ in real.two_person(data, split, 7.0):
            one = rest.layers(p, r)
            dances += [("cmu_two_person/" + name, one), ("cmu_two_person/" + name, one.mirror())]
        _made[split] = build.load_sources(data, split), sounds.Sounds(data, split), dances
    return _made[split]


def talk(data, split, index, frames):
    """Clip `index` of a split and its room: the first draw whose body is plausible."""
    src, heard, dances = sources(data, split)
    for attempt in range(build.RETRIES):
        rng = np.random.default_rng([17, build.SPLITS.index(split), index, attempt])
        room = Room(rng, frames, heard, dances, GENRES[index % 3])
        clip = simulate.simulate_clip(rng, frames, src, (0.35 + index * 0.6180339887) % 1.0, (0.5 + index * 0.7548776662) % 1.0, index % 6 == 5, room)
        if not (reasons := plausible.faults(clip.positions, clip.rotations, STARTLED)):
            return clip, room
    raise RuntimeError(f"clip {index} of {split}: no plausible draw: {', '.join(sorted(set(reasons)))}")


def heard_in(positions, rotations, room):
    """What is kept beside a clip, of a body as it is in the clip, sources in its space."""
    h = ears.hear(room.sources(), *ears.centre(positions, rotations))
    reacts = np.zeros(len(positions), bool)
    for e in room.events:
        if e.reaction != "stay":
            reacts[e.onset:e.until + 20] = True
    return {"wave": np.round(ears.squashed(h.ears) * 32767).astype(np.int16), "levels": h.levels.astype(np.float32), "place": h.place.astype(np.float32),
            "known": h.known, "reacts": reacts, "sensitivity": np.float32(GENRES.index(room.genre) - 1)}


def _write(job):
    data, folder, split, index, frames = job
    clip, room = talk(data, split, index, frames)
    place = f"hearing/{split}/{index}"
    seen, positions, rotations, nods = partner.perform(partner.seeded(place), clip.positions, clip.rotations, clip.user, clip.agent_phrases, clip.user_phrases)
    # clips begin at the origin: so do the places of their sounds
    for e in room.events:
        e.place = store.to_session(positions, rotations, e.place[None])[2][0]
    moved, turned, _ = store.to_session(positions, rotations, clip.user)
    name = os.path.join(folder, f"hear_{index:05d}")
    np.savez(name + ".npz", **heard_in(moved, turned, room))
    events = [{k: getattr(e, k) for k in EVENT} | {"place": [round(float(v), 3) for v in e.place]} for e in room.events]
    used = clip.sources + [e.name for e in room.events] + [e.moved for e in room.events if e.moved]
    store.save(name + ".safetensors", positions, rotations, clip.user, clip.agent_voice, clip.user_voice,
               {"split": split, "sources": sorted(set(used)), "gaze_level": f"{clip.level.mean():.4f}", "seed": place, "kind": "talk", "genre": room.genre,
                "agent_phrases": build._seconds(clip.agent_phrases), "user_phrases": build._seconds(clip.user_phrases), "joins": clip.joins,
                "user_nods": nods, "events": events}, seen)
    return [e.reaction for e in room.events]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", required=True, help="folder with sounds/, speech/ and motion/")
    parser.add_argument("--out", required=True)
    parser.add_argument("--hours", type=float, default=6.0, help="of train; val and test have 0.06 and 0.1 times as much [6]")
    parser.add_argument("--workers", type=int, default=1)
    args = parser.parse_args()
    for s, split in enumerate(build.SPLITS):
        folder = os.path.join(args.out, split)
        os.makedirs(folder, exist_ok=True)
        jobs = [(args.data, folder, split, i, n) for i, n in enumerate(build.clip_lengths(17, s, args.hours * SHARES[split]))]
        with ProcessPoolExecutor(args.workers, get_context("spawn")) as pool:
            done = [r for reactions in pool.map(_write, jobs, chunksize=2) for r in reactions]
        print(f"{split}: {len(jobs)} conversations, {len(done)} sounds: {build.counts(done)}", flush=True)


if __name__ == "__main__":
    main()
