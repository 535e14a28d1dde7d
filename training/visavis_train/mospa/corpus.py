"""Makes the corpus: 8 s clips of a sound around a person, what both ears hear of it, and what the person does. All of it is simulated.

    python -m visavis_train.mospa.corpus --data DATA --out WORK/mospa/corpus [--clips 1500] [--workers 2]

Writes OUT/{train,val,test}/{motion,left,right,location}.npy, clips.json and a few ears' sounds as WAV. Needs `soundfile`, and fluidsynth for music.
"""
import argparse
import json
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
from scipy.io import wavfile

from ..motion import rig
from . import ears, features, layout, react, sounds

SPLITS = {"train": 1.0, "val": 0.08, "test": 0.16}     # of --clips
WAVES = 24
_made = {}


def sources(data, split):
    if split not in _made:
        _made.clear()
        _made[split] = sounds.Sounds(data, split), react.load(data, split)
    return _made[split]


def plausible(p):
    """No joint jumps, nothing sinks: what a clip must pass to be kept."""
    step = np.linalg.norm(np.diff(p, axis=0), axis=-1).max()
    return step * rig.FPS < 12.0 and p[..., 1].min() > -0.08 and np.isfinite(p).all()


def scene(data, split, index):
    """What sounds and what the person does in clip `index` of a split: motion [240, 264], location [3], the source's sound [N] in pascals at 1 m, what is known
    of it, and the generator for what is drawn after that."""
    heard, moves = sources(data, split)
    order = list(sounds.CLASSES)
    kind, genre = order[index % len(order)], react.GENRES[index // len(order) % 3]
    for attempt in range(8):
        rng = np.random.default_rng([index, sorted(SPLITS).index(split), attempt])
        onset = int(rng.uniform(0.5, 2.0) * rig.FPS)
        azimuth, away = rng.uniform(-np.pi, np.pi), rng.uniform(1.0, 5.0)
        low, high = sounds.HEIGHT.get(kind, (0.6, 1.5))
        place = np.array([away * np.sin(azimuth), rng.uniform(low, high), away * np.cos(azimuth)])
        reaction = react.TABLE[kind][react.GENRES.index(genre)]
        p, r, begin, used = react.perform(rng, moves, reaction, genre, place, onset)
        if len(p) == react.FRAMES and plausible(p):
            break
    else:
        raise RuntimeError(f"{kind}, {genre}: no plausible draw for clip {index} of {split}")
    x, place = layout.from_world(p, r, place)
    wave = np.zeros(react.FRAMES * features.HOP)
    name = ""
    if kind != "silence":
        sound, name = heard.draw(rng, kind)
        sound = sound * 10 ** ((sounds.LEVEL[kind] + rng.uniform(-4, 4) - 94) / 20)
        first = onset * features.HOP
        wave[first:first + len(sound)] = sound[:len(wave) - first]
    told = {"class": kind, "genre": genre, "reaction": reaction, "onset": onset / rig.FPS, "begin": begin, "sound": name, "motion": used}
    return x, place, wave, told, rng


def clip(data, split, index):
    """Clip `index` of a split: motion [240, 264], ears' features [2, 240, 132], location [3], what is known of it, both ears' sound [2, N]."""
    x, place, wave, told, rng = scene(data, split, index)
    both = ears.render(wave, place, ears.draw_room(rng, place), rng)
    return x, np.stack([features.ear(y) for y in both]), place, told, both if index < WAVES else None


def _clip(job):
    return clip(*job)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", required=True, help="folder with sounds/, speech/ and motion/")
    parser.add_argument("--out", required=True)
    parser.add_argument("--clips", type=int, default=1500, help="of train; val and test have 0.08 and 0.16 times as many [1500]")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--splits", default="test,val,train")
    args = parser.parse_args()
    for split in args.splits.split(","):
        place, n = os.path.join(args.out, split), round(args.clips * SPLITS[split])
        os.makedirs(place, exist_ok=True)
        rows = {"motion": (264,), "left": (features.SIZE,), "right": (features.SIZE,)}
        arrays = {k: np.zeros((n, react.FRAMES, *v), np.float32) for k, v in rows.items()} | {"location": np.zeros((n, 3), np.float32)}
        clips = []
        with ProcessPoolExecutor(args.workers, mp_context=get_context("fork")) as pool:
            for i, (x, heard, where, told, both) in enumerate(pool.map(_clip, [(args.data, split, i) for i in range(n)], chunksize=4)):
                arrays["motion"][i], arrays["left"][i], arrays["right"][i], arrays["location"][i] = x, heard[0], heard[1], where
                clips.append(told)
                if both is not None:
                    name = os.path.join(place, f"{i:04d}-{told['class']}-{told['genre']}")
                    wavfile.write(name + ".wav", features.RATE, np.round(both.T * 32767).astype(np.int16))
                    with open(name + ".json", "w") as f:
                        json.dump(told | {"location": where.tolist()}, f)
                if i % 100 == 99:
                    print(f"{split}: {i + 1} of {n}", flush=True)
        for k, v in arrays.items():
            np.save(os.path.join(place, k + ".npy"), v)
        with open(os.path.join(place, "clips.json"), "w") as f:
            json.dump(clips, f)


if __name__ == "__main__":
    main()
