"""Other recordings of the same kind: there are two dozen of a class to learn from, and a listener meets others."""
import numpy as np
from scipy.signal import fftconvolve, lfilter, resample_poly

from . import ears

SPEEDS = ((1, 1), (9, 10), (10, 9), (10, 11), (11, 10), (8, 9), (9, 8), (7, 8), (8, 7), (5, 6), (6, 5), (4, 5), (5, 4))     # of a recording, with its pitch


def shelf(rng, y):
    """Brighter or duller, by up to some 10 dB, about a corner of 100 to 6000 Hz."""
    corner, gain = np.exp(-2 * np.pi * np.exp(rng.uniform(np.log(100), np.log(6000))) / ears.RATE), 10 ** (rng.uniform(-10, 10) / 20)
    low = lfilter([1 - corner], [1, -corner], y)
    return low * gain + (y - low)


def roomy(rng, y):
    """In a room: an exponential tail of noise, 0.1 to 0.6 s to -60 dB."""
    t = np.arange(int(ears.RATE * rng.uniform(0.1, 0.6)))
    tail = rng.standard_normal(len(t)) * np.exp(-6.9 * t / len(t))
    return y + rng.uniform(0.1, 0.6) * fftconvolve(y, tail / np.linalg.norm(tail))[:len(y)]


def varied(rng, y):
    """A sound [N] as another recording of its kind might be: faster or slower, brighter or duller, in a room; [M]."""
    up, down = SPEEDS[rng.integers(len(SPEEDS))]
    level = np.sqrt(np.square(y).mean() + 1e-12)
    y = shelf(rng, shelf(rng, resample_poly(y, up, down)))
    if rng.random() < 0.4:
        y = roomy(rng, y)
    return y * level / np.sqrt(np.square(y).mean() + 1e-12)
