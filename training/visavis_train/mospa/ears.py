"""What two ears hear of a source: spherical head, distance, first reflections of a room and a short diffuse tail.

Delays are Woodworth's (1938), level and shadow the one-pole one-zero filter of Brown and Duda (1998). Samples are pascals, clipped to +-1: RMS 1 is 94 dB SPL.
The head stands where it is at frame 0: centre (0, 1.6, 0), facing +Z, the left ear at +X.
"""
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from .features import RATE

RADIUS, SOUND = 0.0875, 343.0
CENTRE = np.array([0.0, 1.6, 0.0])
EARS = np.array([[1.0, 0, 0], [-1.0, 0, 0]])          # left, right
SHADOW, DARKEST = 0.1, np.radians(150)                 # least high-frequency gain, and the angle from the ear's axis where it is
NEAREST = 0.3                                          # metres from the centre; a nearer source is heard as from there


@dataclass
class Room:
    """Walls x [2], floor and ceiling y [2] and walls z [2] in metres (infinity: none), the share of amplitude they reflect, seconds of the tail's fall
    by 60 dB, its amplitude at the start relative to the direct sound at 1 m."""
    low: np.ndarray
    high: np.ndarray
    reflect: float
    fall: float
    tail: float


def draw_room(rng, source):
    """A room around the head and the source; without a ceiling where the source is higher than 3 m."""
    ends = np.stack([np.zeros(3), source])
    low, high = ends.min(0) - rng.uniform(0.7, 2.5, 3), ends.max(0) + rng.uniform(0.7, 2.5, 3)
    low[1], high[1] = 0.0, rng.uniform(2.4, 3.2) if source[1] < 2.3 else np.inf
    return Room(low, high, rng.uniform(0.2, 0.6), rng.uniform(0.15, 0.45), rng.uniform(0.005, 0.02))


def images(room, source):
    """[(place, gain)] of the source and its mirror images of the first order."""
    out = [(source, 1.0)]
    for axis in range(3):
        for wall in (room.low[axis], room.high[axis]):
            if np.isfinite(wall):
                mirrored = source.copy()
                mirrored[axis] = 2 * wall - source[axis]
                out.append((mirrored, room.reflect))
    return out


def paths(place):
    """Distance [m], delay [s, 2] and the shadow filter's high-frequency gain [2] of a source at a place [3]."""
    d = place - CENTRE
    r = max(float(np.linalg.norm(d)), 1e-6)
    angle = np.arccos(np.clip(EARS @ (d / r), -1, 1))
    r = max(r, NEAREST)
    around = np.where(angle < np.pi / 2, -np.cos(angle), angle - np.pi / 2)
    gain = (1 + SHADOW / 2) + (1 - SHADOW / 2) * np.cos(angle / DARKEST * np.pi)
    return r, (r + RADIUS * around) / SOUND, gain


def render(sound, source, room, rng, noise_db=30.0):
    """Both ears' samples [2, N] of a sound [N] that the source makes, as it is at 1 m."""
    n = len(sound)
    size = next_fast_len(n + RATE // 2)
    omega = 2 * np.pi * rfftfreq(size, 1 / RATE)
    bend = 1j * omega / (2 * SOUND / RADIUS)
    heard = np.zeros((2, len(omega)), complex)
    for place, gain in images(room, np.asarray(source, float)):
        r, delay, high = paths(place)
        for ear in (0, 1):
            heard[ear] += gain / r * np.exp(-1j * omega * delay[ear]) * (1 + high[ear] * bend) / (1 + bend)
    length = min(int(RATE * room.fall), RATE // 2)
    fall = np.exp(-6.9 * np.arange(length) / length)
    tails = rng.standard_normal((2, length)) * fall * room.tail
    first = int(RATE * (paths(np.asarray(source, float))[1].min() + 0.004))
    heard += rfft(np.pad(tails, ((0, 0), (first, 0)))[:, :size], size, axis=-1)
    out = irfft(heard * rfft(sound, size), size, axis=-1)[:, :n]
    return np.clip(out + 10 ** ((noise_db - 94) / 20) * rng.standard_normal(out.shape), -1, 1)
