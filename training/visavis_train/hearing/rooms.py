"""Rooms without a conversation: sounds one after the other about a head that stands, and what they call for. Many more than a corpus has clips of, each as
another recording of its kind might be (`variety`).

    python -m visavis_train.hearing.rooms --data DATA --hearing runs/hearing.pt --streams 4000 --out runs/rooms.pt [--workers 2]
"""
import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import torch

from ..mospa import sounds
from ..mospa.react import GENRES
from ..train import common
from ..train.cache import load_audio
from . import ears
from .events import Room
from .variety import varied

FRAMES, FIRST, PAUSE = 480, (0.6, 3.0), (0.8, 4.0)
_made = {}


class Various:
    """Sounds of a split, varied."""

    def __init__(self, heard):
        self.heard = heard

    def draw(self, rng, kind):
        y, name = self.heard.draw(rng, kind)
        first = int(rng.integers(0, len(y) // 2)) if rng.random() < 0.3 else 0
        return varied(rng, y[first:]), name


def room(rng, heard, genre):
    """Sounds about a head at 1.6 m that turns a little: the room and what is heard."""
    made = Room(rng, FRAMES, Various(heard), [], genre, first=FIRST, pause=PAUSE)
    for e in made.events:
        made._place(e, np.zeros(2), 0.0)
    yaw = rng.uniform(-np.pi, np.pi) + np.cumsum(rng.normal(0, 0.02, FRAMES))
    h = ears.hear(made.sources(), np.tile([0.0, 1.6, 0.0], (FRAMES, 1)), np.stack([np.cos(yaw), 0 * yaw, -np.sin(yaw)], 1))
    h.ears += 10 ** (rng.uniform(-86, -66) / 20) * rng.standard_normal(h.ears.shape)
    return made, h


@torch.no_grad()
def _streams(job):
    data, hearing, first, count = job
    if not _made:
        torch.set_num_threads(1)
        _made["heard"], _made["encoder"] = sounds.Sounds(data, "train"), load_audio(hearing)
    out = []
    for i in range(first, first + count):
        made, h = room(np.random.default_rng([31, i]), _made["heard"], GENRES[i % 3])
        sound = ears.listen(_made["encoder"], ears.squashed(h.ears)).half()
        out.append((sound, torch.tensor(h.levels, dtype=torch.float32), GENRES.index(made.genre) - 1.0,
                    [{k: getattr(e, k) for k in ("reaction", "onset", "end", "until")} for e in made.events]))
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", required=True, help="folder with sounds/ and speech/")
    parser.add_argument("--hearing", required=True, help="checkpoint of visavis_train.hearing.encoder")
    parser.add_argument("--out", required=True)
    parser.add_argument("--streams", type=int, default=4000, help=f"of {FRAMES / 30:.0f} s [4000]")
    parser.add_argument("--workers", type=int, default=1)
    args = parser.parse_args()
    jobs = [(args.data, args.hearing, i, min(20, args.streams - i)) for i in range(0, args.streams, 20)]
    with ProcessPoolExecutor(args.workers, get_context("spawn")) as pool:
        made = [s for part in pool.map(_streams, jobs) for s in part]
    sound, levels, sensitivity, events = zip(*made)
    common.save(args.out, sound=torch.cat(sound), levels=torch.cat(levels), sensitivity=torch.tensor(sensitivity),
                starts=torch.arange(len(made) + 1) * FRAMES, events=json.dumps(events))
    print(f"{len(made)} streams, {sum(map(len, events))} sounds", flush=True)


if __name__ == "__main__":
    main()
