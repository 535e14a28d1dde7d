"""What the agent hears of the sounds around it, frame by frame (mirrors src/hearing).

Two ears on the agent's own head, which moves: delay after Woodworth (1938), level and shadow after Brown and Duda (1998), causal. Samples are pascals 1 m
from the source: RMS 1 is 94 dB SPL.
"""
from dataclasses import dataclass

import numpy as np
import torch
from scipy.signal import lfilter

from ..mospa.ears import DARKEST, NEAREST, RADIUS, SHADOW, SOUND
from ..motion import rig
from ..train.geometry import to_local

HEAD = rig.INDEX["head"]
RATE, FRAME = 24000, 800
BEND = RATE * RADIUS / SOUND       # of the shadow filter, in samples
SQUASH = 0.2                       # pascals that the encoder hears as one half
FALL, KNOWN, HOLD = 1.5, 35.0, 60  # dB a frame by which a source is forgotten, dB from which its place is known, frames for which it stays so
SILENT = (10 * np.log10(1e-7) + 94 - 60) / 20     # level of silence, as networks take it
WARM = 16                          # frames of silence that the encoder has heard before it begins


@dataclass
class Source:
    """A sound [N] that begins with frame `first` at a place [3] in the world."""
    first: int
    wave: np.ndarray
    place: np.ndarray


@dataclass
class Heard:
    """Of T frames: both ears [2, 800 T], levels [T, 2] as networks take them, the salient source's place [T, 3] and whether it is known [T]."""
    ears: np.ndarray
    levels: np.ndarray
    place: np.ndarray
    known: np.ndarray


def decibels(x):
    """Level [dB SPL] of each frame of x [..., 800 T] -> [..., T]."""
    return 10 * np.log10(np.square(x.reshape(*x.shape[:-1], -1, FRAME)).mean(-1) + 1e-7) + 94


def centre(positions, rotations):
    """Middle between the ears [T, 3] and the way to the left one [T, 3] of bodies [T, J, 3], [T, J, 3, 3]."""
    head = rotations[:, HEAD]
    return positions[:, HEAD] + head @ np.array([0.0, rig.EYES[1], 0.0]), head[:, :, 0]


def paths(place, middle, left):
    """Distance [T], delay [T, 2] in samples and the shadow filter's high-frequency gain [T, 2] of a place seen from heads [T, 3], [T, 3]."""
    d = place - middle
    r = np.maximum(np.linalg.norm(d, axis=-1), 1e-6)
    side = np.sum(left * d, -1) / r
    angle = np.arccos(np.clip(np.stack([side, -side], -1), -1, 1))
    around = np.where(angle < np.pi / 2, -np.cos(angle), angle - np.pi / 2)
    return np.maximum(r, NEAREST), RADIUS * (1 + around) / SOUND * RATE, (1 + SHADOW / 2) + (1 - SHADOW / 2) * np.cos(angle / DARKEST * np.pi)


def glide(values):
    """Values [T, ...] of frames -> [800 T, ...]: from the frame before's to this one's; the first frame has its own throughout."""
    before = np.concatenate([values[:1], values[:-1]])
    share = (np.arange(FRAME) + 1.0).reshape((1, FRAME) + (1,) * (values.ndim - 1)) / FRAME
    return (before[:, None] + (values - before)[:, None] * share).reshape(-1, *values.shape[1:])


def one(source, middle, left):
    """Both ears [2, N] of a source, its level at the head [T] and its first frame; heads of all frames."""
    n = min(-(-len(source.wave) // FRAME), len(middle) - source.first)
    wave = np.zeros(n * FRAME)
    wave[:len(source.wave)] = source.wave[:n * FRAME]
    r, delay, high = paths(source.place, middle[source.first:source.first + n], left[source.first:source.first + n])
    at = np.arange(n * FRAME)[:, None] - glide(delay)
    low = np.floor(at).astype(int)
    padded = np.concatenate([np.zeros(32), wave, [0.0]])
    x = padded[low + 32] + (at - low) * (padded[low + 33] - padded[low + 32])
    a, before = glide(high), np.concatenate([np.zeros((1, 2)), x[:-1]])
    y = lfilter([1.0], [1 + BEND, 1 - BEND], (1 + a * BEND) * x + (1 - a * BEND) * before, axis=0)
    return (y * glide(1 / r)[:, None]).T, decibels(wave) - 20 * np.log10(r)


def hear(sources, middle, left):
    """What heads [T, 3], [T, 3] hear of sources."""
    frames = len(middle)
    ears, salience = np.zeros((2, frames * FRAME)), np.full((len(sources) + 1, frames), -np.inf)
    for i, s in enumerate(sources):
        y, level = one(s, middle, left)
        ears[:, s.first * FRAME:s.first * FRAME + y.shape[1]] += y
        salience[i, s.first:s.first + len(level)] = level
        for t in range(s.first + 1, frames):
            salience[i, t] = max(salience[i, t], salience[i, t - 1] - FALL)
    place, known, held = np.zeros((frames, 3)), np.zeros(frames, bool), HOLD
    for t, best in enumerate(salience.argmax(0)):
        loud = salience[best, t] >= KNOWN
        held = 0 if loud else held + 1
        known[t] = held <= HOLD
        place[t] = sources[best].place if loud else place[t - 1] * known[t]
    return Heard(ears, np.clip((decibels(ears).T - 60) / 20, -2, 3.5), place, known)


def squashed(ears):
    """What the encoder hears of both ears [2, N]: samples of -1 to 1."""
    m = (ears[0] + ears[1]) / 2
    return m / (SQUASH + np.abs(m))


def listen(encoder, wave):
    """Features [T, D_s] of squashed samples [800 T], after `WARM` frames of silence."""
    wave = torch.cat([torch.zeros(WARM * FRAME), torch.as_tensor(wave, dtype=torch.float32)])
    return encoder(wave[None])[0, WARM:]


def vector(features, levels, place, known, root, sensitivity):
    """Sound vectors [B, S] of tokens from the four frames before them: features [B, 4, D_s], levels [B, 4, 2], the salient source's place [B, 3] and
    whether it is known [B] in the last of them, the agent's root [B, 3] (x, z, yaw) behind it, sensitivity [B]."""
    x, z = to_local(root, place[:, None, [0, 2]].double())[:, 0].unbind(-1)
    rho = torch.hypot(x, z)
    near = rho < 1e-3
    sine, cosine = torch.where(near, 0.0, x / rho.clamp(min=1e-9)), torch.where(near, 1.0, z / rho.clamp(min=1e-9))
    told = torch.stack([torch.ones_like(x), sine, cosine, rho.clamp(min=0.3).log2() - 1, place[:, 1].double() - 1.5], 1) * known[:, None]
    return torch.cat([features.flatten(1), levels.flatten(1), told.to(features.dtype), sensitivity[:, None].to(features.dtype)], 1)


def called(sound, features, count):
    """How much sound vectors [..., S] of frames of `features` call for a reaction [...], 0 to 1: shares of all `count` reactions, which are the last of a
    frame's, but that of the first, none."""
    return 1 - sound[..., :4 * features].unflatten(-1, (4, features))[..., features - count].mean(-1)
