"""How well the runtime tells from two ears where a sound in a room is: rendered scenes through `visavis locate`.

    python -m visavis_train.hearing.locate --data DATA --visavis target/release/visavis [--scenes 540] [--seed 1] [--split val]

A scene is a sound of `mospa.sounds` at the level and height of its class, 1 to 5 m away at any azimuth, in a room of `mospa.ears`: first reflections, a tail,
noise of 30 dB SPL. Reflections come to the head as it is turned when they arrive. Each is heard by a head that stays still and by one that turns by 40
degrees within a second, from a third of a second after the onset on, to the side where the still one had it by then. The constants of `hearing/locate.rs` were
chosen on scenes of the test split.
"""
import argparse
import os
import subprocess
import tempfile
from dataclasses import dataclass

import numpy as np
from scipy.io import wavfile
from scipy.signal import fftconvolve

from ..mospa import ears as rooms
from ..mospa.sounds import CLASSES, HEIGHT, LEVEL, Sounds
from . import ears
from .ears import FRAME, RATE

FRAMES, FIRST, DELAY = 100, 16, 10          # frames of a scene, that of the onset, from there to the turn
TURN, LONGEST = 40.0, 4.0                   # degrees, seconds of a sound
TIMES = (0.13, 0.4, 1.0, 2.0, 2.7)          # seconds from the onset


@dataclass
class Scene:
    kind: str
    wave: np.ndarray
    place: np.ndarray
    azimuth: float
    room: rooms.Room
    seed: int


def draw(rng, heard, kinds):
    kind = kinds[rng.integers(len(kinds))]
    wave = heard.draw(rng, kind)[0][:int(RATE * LONGEST)] * 10 ** ((LEVEL[kind] + rng.uniform(-4, 4) - 94) / 20)
    azimuth, far, height = rng.uniform(-np.pi, np.pi), rng.uniform(1, 5), rng.uniform(*HEIGHT.get(kind, (0.6, 1.5)))
    place = np.array([far * np.sin(azimuth), height, far * np.cos(azimuth)])
    return Scene(kind, wave, place, azimuth, rooms.draw_room(rng, place), int(rng.integers(1 << 30)))


def render(scene, yaw, noise=30.0):
    """Both ears [2, 800 T] of a head with these yaws [T], radians."""
    rng, n = np.random.default_rng(scene.seed), len(yaw) * FRAME
    middle, left = np.tile(rooms.CENTRE, (len(yaw), 1)), np.stack([np.cos(yaw), 0 * yaw, -np.sin(yaw)], -1)
    wave = np.concatenate([np.zeros(FIRST * FRAME), scene.wave, np.zeros(n)])[:n]
    out, near = np.zeros((2, n)), np.linalg.norm(scene.place - rooms.CENTRE)
    for place, gain in rooms.images(scene.room, scene.place):
        late = int(round((np.linalg.norm(place - rooms.CENTRE) - near) / rooms.SOUND * RATE))
        out += ears.one(ears.Source(0, gain * np.concatenate([np.zeros(late), wave])[:n], place), middle, left)[0]
    length = int(RATE * scene.room.fall)
    fall, start = np.exp(-6.9 * np.arange(length) / length) * scene.room.tail, int(RATE * 0.004)
    for ear in out:
        ear[start:] += fftconvolve(wave, rng.standard_normal(length) * fall)[:n - start]
    return out + 10 ** ((noise - 94) / 20) * rng.standard_normal(out.shape)


def turned(side):
    """Yaws [T] of a head that turns to a side, -1, 0 or 1."""
    u = np.clip((np.arange(FRAMES) - FIRST - DELAY) / 30, 0, 1)
    return np.radians(side * TURN * u * u * (3 - 2 * u))


def estimate(program, folder, heard, yaw):
    """The azimuths [blocks] that the runtime tells, radians; NaN where it knows none."""
    sound, turns = os.path.join(folder, "ears.wav"), os.path.join(folder, "turns.csv")
    wavfile.write(sound, RATE, heard.T.astype(np.float32))
    with open(turns, "w") as f:
        f.write("t,yaw\n" + "".join(f"{t / 30:.6f},{np.degrees(y):.4f}\n" for t, y in enumerate(yaw)))
    rows = subprocess.run([program, "locate", sound, "--turns", turns], check=True, capture_output=True, text=True).stdout.split()[1:]
    return np.radians([float(row.split(",")[1] or "nan") for row in rows])


def off(a, b):
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi)


def side(a):
    """The angle to the plane between the ears of a head that faces 0: front and back are one."""
    return np.arcsin(np.sin(a))


def row(name, told, truth):
    """Figures of estimates [S, blocks]: degrees, unknown ones count as 90."""
    ends, first = (np.arange(told.shape[1]) + 1) * 4 / 30 - FIRST / 30, FIRST // 4
    at = [int(np.flatnonzero(ends >= t - 1e-6)[0]) for t in TIMES]
    for what, error in (("all angles", off(told, truth[:, None])), ("lateral", np.abs(side(told) - side(truth)[:, None]))):
        error = np.degrees(np.where(np.isnan(error), np.pi / 2, error))
        cells = " ".join(f"{t:4.2f} s {np.median(error[:, i]):5.1f} ({np.quantile(error[:, i], 0.75):5.1f})" for t, i in zip(TIMES, at))
        good = error[:, first:] <= 15
        times = np.where(good.any(1), ends[first + good.argmax(1)], np.inf)
        print(f"{name:8} {what:10} {cells}; within 15 degrees at the end {good[:, -1].mean():.2f}, at first after {np.median(times):.2f} s (median)", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", required=True, help="folder with sounds/ and speech/")
    parser.add_argument("--visavis", default="target/release/visavis", help="the command [target/release/visavis]")
    parser.add_argument("--scenes", type=int, default=540)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--split", default="val")
    args = parser.parse_args()
    rng, heard = np.random.default_rng(args.seed), Sounds(args.data, args.split)
    kinds = [c for c in CLASSES if c != "silence"]
    scenes, told = [draw(rng, heard, kinds) for _ in range(args.scenes)], [[], []]
    with tempfile.TemporaryDirectory() as folder:
        for scene in scenes:
            yaw = turned(0)
            told[0].append(estimate(args.visavis, folder, render(scene, yaw), yaw))
            seen = told[0][-1][(FIRST + DELAY) // 4 - 1]
            yaw = turned(-1 if seen < 0 else 1)
            told[1].append(estimate(args.visavis, folder, render(scene, yaw), yaw))
    truth, told = np.array([s.azimuth for s in scenes]), np.array(told)
    far, kind = np.array([np.hypot(s.place[0], s.place[2]) for s in scenes]), np.array([s.kind for s in scenes])
    print(f"{len(scenes)} scenes, seed {args.seed}: degrees off, median (upper quartile)")
    for name, some in (("still", told[0]), ("turning", told[1])):
        row(name, some, truth)
    for low, high in ((1, 2), (2, 3.5), (3.5, 5)):
        inside = (far >= low) & (far < high)
        row(f"{low}-{high} m", told[1][inside], truth[inside])
    last = np.degrees(np.where(np.isnan(told[1]), np.pi / 2, off(told[1], truth[:, None])))[:, -1]
    print("turning, last, by class: " + ", ".join(f"{k} {np.median(last[kind == k]):.0f}" for k in kinds if (kind == k).any()))


if __name__ == "__main__":
    main()
