"""Motion that the runtime streams to the scenes of the test split, for a row of `mospa.evaluate`.

    python -m visavis_train.mospa.streamed --data DATA --corpus WORK/mospa/corpus --visavis target/release/visavis --model B.safetensors --out streamed.npy

Each scene is a session of `visavis generate`: nobody there, both voices silent, the clip's source at its place (`push_sound`), the clip's sensitivity. The agent hears with
its own head, and without the room's reflections. Needs `soundfile`, and fluidsynth for music.
"""
import argparse
import os
import subprocess
import tempfile

import numpy as np
from scipy.io import wavfile

from ..motion import rig
from ..motion.bvh import read_bvh
from . import corpus, features, layout, react
from .data import Split


def play(program, model, folder, seed, place, wave, told):
    """Motion [240, 264] of one scene."""
    silence, sound = (os.path.join(folder, name) for name in ("silence.wav", "sound.wav"))
    wavfile.write(silence, features.RATE, np.zeros(len(wave), np.float32))
    argv = [program, "generate", "--model", model, "--agent", silence, "--user", silence, "--sensitivity", told["genre"], "--seed", str(seed), "--out", folder]
    if wave.any():
        first = round(told["onset"] * features.RATE)
        wavfile.write(sound, features.RATE, wave[first:].astype(np.float32))
        argv += ["--sound", f"{sound}@" + ",".join(f"{v:.4f}" for v in place) + f":t={told['onset']:.4f}"]
    subprocess.run(argv, check=True, capture_output=True)
    take = read_bvh(os.path.join(folder, "motion.bvh"))
    positions, rotations = take.fk()
    joints = [take.skeleton.names.index(name) for name in rig.NAMES]
    return layout.from_world(positions[:react.FRAMES, joints] / 100, rotations[:react.FRAMES, joints])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    for name in ("data", "corpus", "model", "out"):
        parser.add_argument(f"--{name}", required=True)
    parser.add_argument("--visavis", default="target/release/visavis", help="the command [target/release/visavis]")
    args = parser.parse_args()
    held, out = Split(args.corpus, "test"), []
    with tempfile.TemporaryDirectory() as folder:
        for i, kept in enumerate(held.clips):
            _, place, wave, told, _ = corpus.scene(args.data, "test", i)
            if (told["sound"], told["onset"]) != (kept["sound"], kept["onset"]):
                raise SystemExit(f"{args.corpus} was made of other data: clip {i} is not {told['sound']}")
            out.append(play(args.visavis, args.model, folder, i, place, wave, told))
    np.save(args.out, np.stack(out))


if __name__ == "__main__":
    main()
