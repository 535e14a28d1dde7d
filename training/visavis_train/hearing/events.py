"""Sounds that interrupt a conversation, and what the agent does about them.

Which reaction a class of sound and a sensitivity call for is `mospa.react.TABLE`. Here it is laid over a conversation that goes on: where the body is
wanted (`urge`, asked by `corpus.encounter`), what the eyes go to (`look`) and what the trunk and the arms do (`act`). Then the rules of the conversation
have the body back. Times as in `mospa.react`, but that nothing begins within a block (0.13 s) of the onset, which is the runtime's delay of hearing.
"""
from dataclasses import dataclass, field, fields

import numpy as np

from ..corpus import gestures, rest
from ..corpus.signals import FPS, keyed, minjerk
from ..motion import rig
from ..mospa.react import GENRES, PACE, TABLE
from ..mospa.sounds import CLASSES, HEIGHT, LEVEL
from .ears import FRAME, RATE, Source

GUARD, EARS = np.array([-0.02, -0.16, 0.30]), np.array([-0.055, 0.165, 0.055])   # wrists before the face, and over the ears
FIRST, PAUSE = (3.0, 10.0), (3.0, 9.0)      # seconds before the first sound, and from one's end to the next
LONGEST = 6.0                               # seconds of a sound


@dataclass
class Event:
    """One sound: its frames `onset` to `end`, its waveform as it is at 1 m [N], and the reaction: from `begin` to `until` (frames)."""
    kind: str
    reaction: str
    name: str
    wave: np.ndarray
    onset: int
    end: int
    begin: int
    until: int
    look: int                        # frame from which the eyes go there
    place: np.ndarray = None
    goals: list = field(default_factory=list)   # (frame, floor place [2] or None, heading or None, greatest speed)
    moved: str = ""


class Room:
    """The sounds of a clip of `frames` frames. `heard`: `mospa.sounds.Sounds`; `dances`: layers (`rest.Rest`) with their names."""

    def __init__(self, rng, frames, heard, dances, genre=None, classes=None, first=FIRST, pause=PAUSE):
        self.rng, self.frames, self.dances = rng, frames, dances
        self.genre = genre or GENRES[rng.integers(len(GENRES))]
        self.events, t = [], int(FPS * rng.uniform(*first))
        classes = list(classes or [c for c in CLASSES if c != "silence"])
        while t < frames - 3 * FPS:
            event = self._event(classes[rng.integers(len(classes))], heard, t)
            self.events.append(event)
            t = max(event.end, event.until) + int(FPS * rng.uniform(*pause))

    def _event(self, kind, heard, onset):
        rng = self.rng
        wait = lambda a, b: rng.uniform(a, b) * PACE[self.genre]
        wave, name = heard.draw(rng, kind)
        wave = wave[:int(RATE * rng.uniform(1.0, LONGEST))] * 10 ** ((LEVEL[kind] + rng.uniform(-4, 4) - 94) / 20)
        end, reaction = onset + -(-len(wave) // FRAME), TABLE[kind][GENRES.index(self.genre)]
        sounds, seen = (end - onset) / FPS, max(wait(0.02, 0.12), 0.0)
        begin, lasts = {
            "stay": (0.0, 0.0), "look": (seen + 0.2, rng.uniform(2.2, 3.6)), "approach": (seen + 0.2, rng.uniform(4.0, 6.0)),
            "flinch": (rng.uniform(0.14, 0.20), rng.uniform(2.0, 3.2)), "cover": (wait(0.35, 0.55), max(sounds + 0.2, 2.0)),
            "run": (wait(0.3, 0.5), rng.uniform(4.5, 6.0)), "dance": (wait(0.8, 1.6), max(sounds + 0.3, 3.5))}[reaction]
        at = lambda s: onset + int(round(FPS * s))
        return Event(kind, reaction, name, wave, onset, end, at(begin), at(lasts), at(seen))

    def sources(self):
        return [Source(e.onset, e.wave, e.place) for e in self.events]

    def now(self, t):
        """The event that the body reacts to in frame t, or None."""
        return next((e for e in self.events if e.onset <= t < e.until and e.reaction != "stay"), None)

    def urge(self, t, root, yaw):
        """Where a body at `root` [2] with heading `yaw` wants to be in frame t: (floor place or None, heading or None, greatest speed), or None."""
        for e in self.events:
            if e.onset == t:
                self._place(e, root, yaw)
        e = self.now(t)
        goal = None
        if e is not None:
            for frame, place, heading, speed in e.goals:
                if t >= frame:
                    before = goal or (None, None, 0.0)
                    goal = (before[0] if place is None else place, before[1] if heading is None else heading, speed)
        return goal

    def _place(self, e, root, yaw):
        """Draws the source about a body, and the goals of its reaction."""
        rng = self.rng
        wait = lambda a, b: int(FPS * rng.uniform(a, b) * PACE[self.genre])
        bearing, far = yaw + rng.uniform(-np.pi, np.pi), rng.uniform(1.0, 5.0)
        towards = np.array([np.sin(bearing), np.cos(bearing)])
        low, high = HEIGHT.get(e.kind, (0.6, 1.5))
        e.place = np.array([root[0] + far * towards[0], rng.uniform(low, high), root[1] + far * towards[1]])
        turn = yaw + rig.wrap(bearing - yaw)
        if e.reaction in ("look", "approach"):
            e.goals = [(e.look + wait(0.22, 0.36), root.copy(), turn, 0.8)]
            if e.reaction == "approach" and far > 1.4:
                e.goals.append((e.goals[0][0] + wait(0.3, 0.8), root + towards * min(far - rng.uniform(0.8, 1.2), 1.6), turn, 1.2))
        elif e.reaction == "flinch":
            e.goals = [(e.begin + wait(0.25, 0.4), root - towards * rng.uniform(0.35, 0.8), turn, 1.1)]
        elif e.reaction == "cover":
            away = turn + np.pi + rng.normal(0, 0.3) if self.genre == "sensitive" else None
            e.goals = [(e.begin + 4, root - towards * rng.uniform(0.2, 0.5), away, 0.9)]
        elif e.reaction == "run":
            flee = bearing + np.pi + rng.normal(0, 0.2)
            out, back = root + np.array([np.sin(flee), np.cos(flee)]) * rng.uniform(2.2, 3.2), e.begin + int(FPS * rng.uniform(2.4, 2.9))
            e.goals = [(e.begin, out, yaw + rig.wrap(flee - yaw), 1.7), (back, None, turn, 1.0)]
        elif e.reaction == "dance":
            e.goals = [(e.begin - 12, root.copy(), None, 0.4)]

    def busy(self):
        """Frames [T] bool in which no gesture of the conversation begins."""
        out = np.zeros(self.frames, bool)
        for e in self.events:
            if e.reaction not in ("stay", "look", "approach"):
                out[e.onset:e.until] = True
        return out

    def look(self, target, offset):
        """What the eyes go to [T, 3] and how far they look past it [T, 2], from those of the conversation."""
        target, offset = target.copy(), offset.copy()
        for e in self.events:
            if e.reaction == "stay" or e.place is None:
                continue
            a, b = e.look, min(e.until, self.frames)
            if e.reaction == "dance":
                b = min(e.look + 40, b)
            elif e.reaction == "cover":
                b = min(e.begin + 6, b)
            elif e.reaction == "run":
                (_, out, _, _), (a, _, _, _) = e.goals     # away, and then a look back
                if self.genre != "sensitive":
                    target[e.look:e.begin] = e.place
                target[e.begin:a] = [out[0] * 4 - 3 * e.place[0], 1.4, out[1] * 4 - 3 * e.place[2]]
            target[a:b] = e.place
            inside = slice(e.look, min(e.until, self.frames))
            offset[inside] *= (1 - keyed(self.frames, [0, e.look, e.look + 6, e.until, e.until + 10], np.array([0.0, 0, 1, 1, 0])))[inside, None]
        return target, offset

    def _bump(self, at, rise, hold, fall):
        return keyed(self.frames, [0, at, at + rise, at + rise + hold, at + rise + hold + fall], np.array([0.0, 0, 1, 1, 0]))

    def act(self, own, arms):
        """Lays trunk and arms of the reactions over the rest layers `own` and the arms; returns the head's further pitch [T]."""
        rng, nod = self.rng, np.zeros(self.frames)
        for e in self.events:
            if e.place is None or e.begin >= self.frames - 8:
                continue
            if e.reaction == "flinch":
                size = {"dull": 0.7, "neutral": 0.9, "sensitive": 1.15}[self.genre] * rng.uniform(0.85, 1.15)
                duck = size * self._bump(e.begin, 5, 6, 22)
                nod += self._duck(own, duck, 0.30, 0.07, 0.40)
                self._reach(arms, np.clip(size, 0, 1) * self._bump(e.begin + 1, 6, 10, 26), GUARD)
            elif e.reaction == "cover":
                length = max(e.until - e.begin - 18, 12)
                share = self._bump(e.begin, int(17 * PACE[self.genre]), length, 20)
                nod += self._duck(own, share, 0.22, 0.02, 0.20)
                self._reach(arms, share, EARS)
            elif e.reaction == "run":
                nod += self._duck(own, self._bump(e.onset + 5, 5, 4, 14), 0.15, 0.04, 0.25)
            elif e.reaction == "dance" and self.dances:
                self._dance(e, own, arms)
        return nod

    def _duck(self, own, size, lean, low, pitch):
        own.chest[:, 0] += lean * size
        own.hips[:, 2] += low * size
        own.shoulder[:, :, 2] += 0.25 * size[:, None]
        return pitch * size

    def _reach(self, arms, share, place):
        for side in (0, 1):
            late = np.roll(share, 2) if self.rng.random() < 0.5 else share
            k, goal = late[:, None], np.tile(place + self.rng.normal(0, 0.015, 3), (self.frames, 1))
            arms.wrist[side] = arms.wrist[side] * (1 - k) + goal * k + np.sin(np.pi * k) * [0.05, 0, 0.10]
            arms.elbow[side] = rig.unit(arms.elbow[side] * (1 - k) + gestures.elbow_of(goal, np.full(self.frames, 0.9)) * k)
            arms.active[side] = np.maximum(arms.active[side] * (1 - late), late)
            arms.twist[side] += (rest.TWIST - arms.twist[side]) * late

    def _dance(self, e, own, arms):
        """A stretch of a dance, on the spot: the trunk, the hips over the feet and the arms of a real one."""
        e.moved, dance = self.dances[self.rng.integers(len(self.dances))]
        n = min(e.until, self.frames) - e.begin
        n = min(n, len(dance))
        at = int(self.rng.integers(0, len(dance) - n + 1))
        piece, inside = dance.cut(at, at + n), slice(e.begin, e.begin + n)
        share = np.minimum(minjerk((np.arange(n) + 1) / 18), minjerk((n - np.arange(n)) / 22))
        for f in fields(own):
            layer, new = getattr(own, f.name), getattr(piece, f.name)
            k = share.reshape((-1,) + (1,) * (layer.ndim - 1))
            layer[inside] += k * (new - layer[inside])
        own.elbow[:] = rig.unit(own.elbow)
        for side in (0, 1):
            k = share[:, None]
            arms.wrist[side][inside] += k * (piece.wrist[:, side] - arms.wrist[side][inside])
            arms.elbow[side][inside] = rig.unit(arms.elbow[side][inside] * (1 - k) + piece.elbow[:, side] * k)
            arms.active[side][inside] *= 1 - share
            arms.twist[side][inside] += share * (rest.TWIST - arms.twist[side][inside])
