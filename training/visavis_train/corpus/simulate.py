"""One conversation clip: voices, user, attention, feet, arms -> joint transforms."""
from dataclasses import dataclass

import numpy as np

from . import attention, body, encounter, feet, gestures, voices
from .signals import FPS


@dataclass
class Sources:
    """What a split may draw on: voices {speaker: [Phrase]}, the real call or None, real head paths, arm shapes."""
    voices: dict
    pair: tuple
    paths: list
    spots: np.ndarray
    motifs: np.ndarray


@dataclass
class Simulated:
    positions: np.ndarray
    rotations: np.ndarray
    user: np.ndarray
    agent_voice: np.ndarray   # [800 T] float32 or None
    user_voice: np.ndarray
    speaking: np.ndarray      # [T] bool, the agent's
    level: np.ndarray         # [T] wanted gaze level
    sources: list
    events: list


def simulate_clip(rng, frames, src, level_quantile=None):
    """Simulates one clip of `frames` frames from `src`; everything random comes from `rng`."""
    if src.pair is not None and rng.random() < 0.3:
        talk = voices.cut_pair(rng, src.pair, frames)
    else:
        talk = voices.compose(rng, src.voices, frames, rng.uniform(0.3, 0.7))
    drop = rng.random()                              # one voice, or both, absent in some clips
    keep_agent, keep_user = drop > 0.07, not 0.04 < drop < 0.14
    agent_phrases = talk.agent_phrases if keep_agent else []
    user_phrases = talk.user_phrases if keep_user else []
    speaking = attention.mask(agent_phrases, frames)
    level = attention.level_track(rng, frames, level_quantile)
    offset, bias = attention.offsets(rng, level, speaking)
    mobility = rng.beta(1.2, 1.5)
    enc = encounter.simulate(rng, frames, bias, mobility, src.paths)
    steps = feet.plan(rng, enc.root, enc.yaw)
    if agent_phrases:
        loud = voices.loudness(talk.agent)
        peaks, strength = voices.stress_peaks(loud, agent_phrases)
    else:
        peaks, strength = [], np.zeros(0)
    liveliness = rng.beta(2.2, 1.3)
    arms = gestures.plan(rng, frames, peaks, strength, agent_phrases, src.spots, src.motifs, liveliness, enc.speed)
    eye = np.stack([enc.root[:, 0], np.full(frames, 1.56), enc.root[:, 1]], 1)
    yaw, pitch, roll = attention.head_angles(rng, eye, enc.user, offset, None, enc.yaw)
    pitch = pitch + attention.nods(rng, frames, [b for _, b in user_phrases], speaking) \
        + attention.head_beats(rng, frames, peaks, strength)
    pos, rot = body.assemble(rng, enc, steps, (yaw, pitch, roll), arms)
    return Simulated(pos, rot, enc.user, talk.agent if keep_agent else None, talk.user if keep_user else None,
                     speaking, level, talk.sources, enc.events)
