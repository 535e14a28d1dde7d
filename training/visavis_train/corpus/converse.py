"""Whole gestures of real people above the rest layers: shrug, question, refuse, plead, think, dismiss, talking hands, and
a listener's nods and shakes of the head.

Taken from labelled stretches of one actress (ACCAD) and a talking man (Rocketbox): train split only, since a person is
in one split. Each is laid where its meaning fits the turn and its fastest moment falls on a stressed syllable.
"""
from dataclasses import dataclass, fields, replace

import numpy as np

from ..motion import rig
from .rest import Rest, angles, arm_layers, clear_trunk, layers, take
from .signals import FPS, gaussian, minjerk

ACCAD, ROCKETBOX = "accad_female1/Female1_D3_ConversationGestures", "rocketbox/movebox_conversation"
# (start s, end s, kind) of the ACCAD take; where each kind belongs is told by `PLACES`
SEGMENTS = [(1.9, 3.5, "shrug"), (4.6, 6.5, "shrug"), (6.4, 10.0, "shake"), (10.0, 12.6, "nod"), (16.6, 20.4, "plead"), (21.0, 24.4, "refuse"),
            (24.7, 27.8, "think"), (28.4, 33.8, "question"), (33.6, 36.5, "shrug"), (36.8, 40.3, "plead"), (40.9, 43.5, "dismiss")]
TALK = (3.5, 31.0)            # usable seconds of the talking man, upper body only
# chance of a kind at each of its places: an agent's turn begins, goes on, ends; a phrase of the user ends
PLACES = {"begin": {"think": 0.10}, "within": {"talk": 0.22, "plead": 0.03, "refuse": 0.03, "dismiss": 0.02},
          "end": {"shrug": 0.08, "question": 0.08}, "heard": {"nod": 0.10, "shake": 0.02}}
RAMP_IN, RAMP_OUT = 14, 22


@dataclass
class Piece:
    """One gesture: its layers, what its head adds [T, 3] (yaw, pitch, roll), and the frame of its fastest hand."""
    kind: str
    rest: Rest
    head: np.ndarray
    apex: int


def _piece(kind, rest):
    v = np.linalg.norm(np.gradient(rest.wrist, axis=0), axis=-1).max(1)
    v[:6] = v[-8:] = 0
    about = lambda x: x - np.linspace(0, 1, len(x)).reshape((-1,) + (1,) * (x.ndim - 1)) * (x[-1] - x[0]) - x[0]   # starts and ends at nothing
    rest = replace(rest, hips=about(rest.hips), pelvis=about(rest.pelvis), chest=about(rest.chest), spine=about(rest.spine), head=about(rest.head))
    return Piece(kind, rest, rest.head, int(v.argmax()))


def load(data, split):
    """Pieces of a split, with their mirror images; none outside train."""
    if split != "train":
        return []
    t = take(data, ACCAD)
    whole = layers(t.positions, t.rotations)
    out = [(kind, whole.cut(int(a * FPS), int(b * FPS))) for a, b, kind in SEGMENTS]
    t = take(data, ROCKETBOX)
    lo, hi = (int(x * FPS) for x in TALK)
    p, r = t.positions[lo:hi], t.rotations[lo:hi]
    shoulder, wrist, elbow = arm_layers(p, r)
    wrist = gaussian(clear_trunk(wrist), 2.0)                 # one depth camera: jitter
    zero = np.zeros((len(p), 3))
    head = gaussian(angles(np.swapaxes(r[:, rig.INDEX["upperChest"]], -1, -2) @ r[:, rig.INDEX["head"]]), 3.0)
    man = Rest(zero, zero, zero, np.zeros((len(p), 3, 3)), head - np.median(head, 0), gaussian(shoulder, 3.0), wrist, elbow)
    v = gaussian(np.linalg.norm(np.gradient(wrist, axis=0), axis=-1).max(1), 2.0)
    at = 0
    while at + 3 * FPS < len(v):                              # cut where the hands are slowest, every 3 to 6 s
        end = at + 3 * FPS + int(v[at + 3 * FPS: at + 6 * FPS].argmin())
        out.append(("talk", man.cut(at, end)))
        at = end
    return [_piece(k, r) for kind, rest in out for k, r in ((kind, rest), (kind, rest.mirror()))]


def turns(phrases, pause=1.2):
    """Phrases [(start, end)] grouped into turns [[(start, end), ...], ...]: pauses below `pause` seconds do not end one."""
    out = []
    for ph in phrases:
        if out and ph[0] - out[-1][-1][1] < pause:
            out[-1].append(ph)
        else:
            out.append([ph])
    return out


def _wishes(rng, agent_phrases, user_phrases, peaks, strength, liveliness):
    """(kind, frame of its apex or start, whether that is the apex), as the talk goes, before collisions."""
    peaks, strength = np.asarray(peaks, int), np.asarray(strength)

    def strongest(a, b):
        inside = (peaks >= a * FPS) & (peaks <= b * FPS)
        return int(peaks[inside][strength[inside].argmax()]) if inside.any() else int((a + 0.3) * FPS)

    def draw(place, gain=1.0):
        r = rng.random()
        for kind, chance in PLACES[place].items():
            r -= chance * gain
            if r < 0:
                return kind
        return None

    out = []
    lively = 0.4 + 1.2 * liveliness
    for turn in turns(agent_phrases):
        if (kind := draw("begin", lively)):
            out.append((kind, int((turn[0][0] - 0.9) * FPS), False))
        for a, b in turn[:-1]:
            if b - a > 1.2 and (kind := draw("within", lively)):
                out.append((kind, strongest(a, b), True))
        a, b = turn[-1]
        if (kind := draw("end", lively)):
            out.append((kind, strongest(max(a, b - 1.5), b), True))
    for a, b in user_phrases:
        if (kind := draw("heard")):
            out.append((kind, int((b + rng.uniform(0.0, 0.35)) * FPS), False))
    return sorted(out, key=lambda x: x[1])


def perform(rng, rest, pieces, agent_phrases, user_phrases, peaks, strength, liveliness):
    """Lays pieces over the rest layers. Returns the layers, what the head adds [T, 3], and where hands are taken [T] bool."""
    frames = len(rest)
    head, busy = np.zeros((frames, 3)), np.zeros(frames, bool)
    if not pieces:
        return rest, head, busy
    out = {f.name: getattr(rest, f.name).copy() for f in fields(rest)}
    free = 0
    for kind, at, apex in _wishes(rng, agent_phrases, user_phrases, peaks, strength, liveliness):
        kinds = [p for p in pieces if p.kind == kind]
        if not kinds:
            continue
        piece = kinds[rng.integers(len(kinds))]
        n = len(piece.rest)
        a = at - piece.apex if apex else at
        if a < free or a + n > frames:
            continue
        free = a + n + FPS
        share = np.minimum(minjerk((np.arange(n) + 1) / RAMP_IN), minjerk((n - np.arange(n)) / RAMP_OUT))
        size = rng.uniform(0.75, 1.05)
        for name in ("hips", "pelvis", "chest", "spine"):
            layer = getattr(piece.rest, name)
            out[name][a: a + n] += size * share.reshape((-1,) + (1,) * (layer.ndim - 1)) * layer
        head[a: a + n] += size * share[:, None] * piece.head
        if kind not in ("nod", "shake"):
            k = share[:, None, None]
            for name in ("shoulder", "wrist", "elbow"):
                out[name][a: a + n] += k * (getattr(piece.rest, name) - out[name][a: a + n])
            busy[a: a + n] = True
    out["elbow"] = rig.unit(out["elbow"])
    return Rest(**out), head, busy
