"""One conversation clip: voices, user, attention, feet, arms -> joint transforms."""
from dataclasses import dataclass

import numpy as np

from . import attention, body, converse, encounter, feet, gestures, rest, voices
from .signals import FPS


@dataclass
class Sources:
    """What a split may draw on: voices {speaker: [Phrase]}, the real call or None, real head paths, arm shapes, people at rest
    (rest.Library), gestures (converse.Piece), swings of feet or None."""
    voices: dict
    pair: tuple
    paths: list
    spots: np.ndarray
    motifs: np.ndarray
    rests: rest.Library
    pieces: list
    swings: object


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
    agent_phrases: list       # (start, end) in seconds
    user_phrases: list
    joins: list               # frames (start, end) at which the rest layers change over


SILENT = 1 / 8                    # share of clips in which nobody speaks
LOOKS, LOOKS_SILENT = 0.25, 0.6   # how much of a resting person's own looking about shows


def simulate_clip(rng, frames, src, level_quantile=None, rest_quantile=None, silent=None, room=None):
    """Simulates one clip of `frames` frames from `src`; everything random comes from `rng`, but what the quantiles (of the
    gaze level, of the recordings at rest) and `silent` (nobody speaks) fix. `room`: sounds that interrupt (`hearing.events.Room`)."""
    if src.pair is not None and rng.random() < 0.3:
        talk = voices.cut_pair(rng, src.pair, frames)
    else:
        talk = voices.compose(rng, src.voices, frames, rng.uniform(0.3, 0.7))
    drop = rng.random()                              # one voice, or both, absent in some clips
    silent = rng.random() < SILENT if silent is None else silent
    keep_agent, keep_user = not silent and drop > 0.05, not silent and drop < 0.93
    agent_phrases = talk.agent_phrases if keep_agent else []
    user_phrases = talk.user_phrases if keep_user else []
    speaking = attention.mask(agent_phrases, frames)
    level = attention.level_track(rng, frames, level_quantile)
    offset, bias = attention.offsets(rng, level, speaking)
    mobility = rng.beta(0.5, 4.0) - 0.12 if silent else rng.beta(1.2, 1.5)
    enc = encounter.simulate(rng, frames, bias, mobility, src.paths, (30, 120) if silent else (12, 50), room and room.urge)
    steps = feet.plan(rng, enc.root, enc.yaw, src.swings)
    if agent_phrases:
        loud = voices.loudness(talk.agent)
        peaks, strength = voices.stress_peaks(loud, agent_phrases)
    else:
        peaks, strength = [], np.zeros(0)
    liveliness = rng.beta(2.2, 1.3)
    own, joins, used = rest.compose(rng, src.rests, frames, rest_quantile)
    own, gesture_head, busy = converse.perform(rng, own, src.pieces, agent_phrases, user_phrases, peaks, strength, liveliness)
    busy = busy | room.busy() if room else busy
    arms = gestures.plan(rng, frames, peaks, strength, agent_phrases, src.spots, src.motifs, liveliness, own, busy)
    eye = np.stack([enc.root[:, 0], np.full(frames, 1.56), enc.root[:, 1]], 1)
    # people at rest look about far more than the aversions of a conversation: their own head shows in full where nobody talks
    share = (LOOKS_SILENT if silent else LOOKS) * body.standing(enc, steps)[:, None]
    looked_at, startle = enc.user, 0.0
    if room:
        startle = room.act(own, arms)
        looked_at, offset = room.look(enc.user, offset)
    yaw, pitch, roll = attention.head_angles(rng, eye, looked_at, offset, enc.yaw, gesture_head + share * own.head)
    pitch = pitch + startle
    pitch = pitch + attention.nods(rng, frames, user_phrases, speaking) + attention.head_beats(rng, frames, peaks, strength)
    pos, rot = body.assemble(rng, enc, steps, (yaw, pitch, roll), arms, own)
    return Simulated(pos, rot, enc.user, talk.agent if keep_agent else None, talk.user if keep_user else None,
                     speaking, level, talk.sources + used, enc.events, agent_phrases, user_phrases, joins)
