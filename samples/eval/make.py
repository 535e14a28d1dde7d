#!/usr/bin/env python3
"""Makes the clips of this folder: python samples/eval/make.py [OUT]

Conversations by the corpus' rules (training/visavis_train/corpus) from parts that may be given away: the voices are those of the sample conversation
(../agent.wav, ../user.wav, a synthesiser's), feet, arms, head and the user's path are simulated, nothing is taken from motion capture.
The first two draws that fit are kept: one in which the agent speaks most of the time, one in which it has no voice and listens.
"""
import itertools
import os
import sys

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "..", "training"))
from visavis_train.corpus import plausible, simulate, store, voices  # noqa: E402

FRAMES = 460  # one window of `visavis eval`: 2 s that lead in, 13.3 s that are measured
WANTED = {"speaks": lambda c: c.agent_voice is not None and c.user_voice is not None and c.speaking.mean() > 0.6,
          "listens": lambda c: c.agent_voice is None and c.user_voice is not None}


def sources():
    """Two synthesised speakers, no captured shapes or paths."""
    speakers = {}
    for name in ("agent", "user"):
        audio = voices.read(os.path.join(HERE, "..", f"{name}.wav"))
        speakers[f"espeak-ng:{name}"] = [voices.Phrase(f"samples/{name}.wav", audio[a:b]) for a, b in voices.vad(audio)]
    return simulate.Sources(speakers, None, [], np.zeros((0, 3)), np.zeros((0, 36, 3)))


def main():
    out, src, wanted = sys.argv[1] if len(sys.argv) > 1 else HERE, sources(), dict(WANTED)
    for seed in itertools.count():
        clip = simulate.simulate_clip(np.random.default_rng([1, seed]), FRAMES, src, 0.7)
        if plausible.faults(clip.positions, clip.rotations, plausible.SIMULATED):
            continue
        for name in [n for n, fits in wanted.items() if fits(clip)]:
            del wanted[name]
            path = os.path.join(out, f"talk_{name}.safetensors")
            store.save(path, clip.positions, clip.rotations, clip.user, clip.agent_voice, clip.user_voice,
                       {"split": "sample", "sources": clip.sources, "gaze_level": f"{clip.level.mean():.4f}", "seed": str(seed), "kind": "talk"})
            print(f"{path}: draw {seed}, {os.path.getsize(path) / 1e6:.2f} MB")
        if not wanted:
            return


if __name__ == "__main__":
    main()
