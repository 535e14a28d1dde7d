"""Where the head points: contact with the user and aversions, nods, tilts and speech beats of the head.

Contact is longer when listening than when speaking (Kendon 1967; Argyle & Cook 1976); cognitive aversions go up or
aside at the start of a turn (Andrist et al. 2014). A level per clip (and per stretch of a clip) shifts the whole
from sustained contact to avoidance, so that SARAH's gaze score covers about 0..1. Nods answer the other's phrase ends
(Poggi et al. 2010), head beats mark stressed syllables (Hadar et al. 1983).
"""
import numpy as np

from ..motion import rig
from .signals import FPS, delay, follow, gaussian, keyed, minjerk


def draw_level(rng, r=None):
    """Wanted mean gaze score of a stretch, 0..1: half contact, a quarter shy, a quarter averted. `r`: quantile, else random."""
    r = rng.random() if r is None else r
    if r < 0.52:
        return rng.uniform(0.80, 1.0)
    if r < 0.77:
        return rng.uniform(0.45, 0.80)
    return rng.uniform(-0.05, 0.45)


def level_track(rng, frames, quantile=None):
    """Piecewise constant level [T]; about 40 % of the clips change it once or more. `quantile`: of the first stretch."""
    out = np.empty(frames)
    t = 0
    change = rng.random() < 0.4
    while t < frames:
        n = int(FPS * rng.uniform(12, 35)) if change else frames
        out[t: t + n] = draw_level(rng, quantile if t == 0 else None)
        t += n
    return out


def mask(phrases, frames, close=0.6):
    """Speaking mask [T] with pauses shorter than `close` seconds filled."""
    m = np.zeros(frames, bool)
    last = None
    for a, b in phrases:
        m[int(a * FPS): int(b * FPS) + 1] = True
        if last is not None and 0 < a - last < close:
            m[int(last * FPS): int(a * FPS) + 1] = True
        last = max(b, last or 0)
    return m


def offsets(rng, level, speaking):
    """Off-contact yaw and pitch [T, 2] (rad) of the head and the body's share of it [T].

    The slow part comes from the level: arccos(level) to one side; the fast part are aversions."""
    frames = len(level)
    side = rng.choice([-1, 1])
    keys_t, keys_v, body_v = [0], [], []
    edges = np.flatnonzero(np.diff(level)) + 1
    for i, t in enumerate([0] + edges.tolist()):
        angle = np.arccos(np.clip(level[t] + 0.06, -0.05, 1.0)) if level[t] < 0.8 else abs(rng.normal(0, 0.06))
        if rng.random() < 0.3:
            side = -side
        down = rng.uniform(-0.05, 0.35) * min(1, angle)
        if i:
            keys_t += [t, t + int(FPS * 0.8)]
            keys_v += [keys_v[-1]]
            body_v += [body_v[-1]]
        keys_v.append((side * angle, down))
        body_v.append(side * min(angle * rng.uniform(0.35, 0.7), 1.1))
    slow = keyed(frames, keys_t, keys_v)
    body = keyed(frames, keys_t, body_v)
    fast = np.zeros((frames, 2))
    t = int(FPS * rng.uniform(0.5, 3))
    talkative = rng.uniform(0.7, 1.3)
    while t < frames:
        sp = speaking[t]
        shy = 1 - level[t]
        contact = rng.gamma(3, (0.65 if sp else 1.9) * talkative * (1.0 - 0.5 * min(max(shy, 0), 1)))
        t += int(FPS * contact)
        if t >= frames:
            break
        n = int(FPS * (rng.uniform(0.6, 2.2) if sp else rng.uniform(0.5, 1.6)))
        size = rng.uniform(0.3, 0.85) + 0.3 * rng.random() * (shy > 0.2)
        if not sp:
            size *= 0.6
        up = rng.random() < (0.4 if sp else 0.15)
        direction = rng.choice([-1, 1])
        amp = np.array([direction * size, (-0.5 if up else rng.uniform(-0.1, 0.7)) * size])
        e = min(frames, t + n)
        ramp = int(FPS * 0.1)
        fast[t:e] += amp * minjerk(np.minimum(np.arange(e - t) + 1, e - t - np.arange(e - t)) / max(ramp, 1))[:, None]
        t = e
    return slow + fast, body


def nods(rng, frames, phrases, speaking):
    """Pitch [T] (rad, down positive) of a listener's nods: damped cycles at 1.6-2.6 Hz, 3-10 degrees.

    They answer the ends of the other's phrases (Dittmann & Llewellyn 1968), about 0.3 s after them with a spread of
    0.3 s, and now and then fall within long phrases, at least 2 s after their start; six to ten a minute of the other's
    speech for most listeners (Hadar et al. 1985; Poppe et al. 2010)."""
    out = np.zeros(frames)
    rate = rng.uniform(0.30, 0.80)
    inside = rng.uniform(1.0, 5.0) / 60                  # a second of a long phrase
    free = 0
    wishes = []
    for a, b in phrases:
        if rng.random() < rate:
            wishes.append((b + float(np.clip(rng.normal(0.3, 0.3), -0.2, 1.1)), 1.0))
        for _ in range(rng.poisson(inside * max(b - a - 2.5, 0))):
            wishes.append((rng.uniform(a + 2.0, b - 0.5), 0.7))
    for t, size in sorted(wishes):
        at = int(t * FPS)
        if not free <= at < frames or speaking[at]:
            continue
        f, cycles = rng.uniform(1.6, 2.6), rng.choice([1, 1, 2, 2, 3])
        n = int(FPS * cycles / f)
        x = np.arange(n) / n
        wave = size * rng.uniform(0.06, 0.17) * 0.5 * (1 - np.cos(2 * np.pi * cycles * x)) * (1 - 0.55 * x)
        e = min(frames, at + n)
        out[at:e] += wave[: e - at]
        free = at + n + FPS
    return gaussian(out, 1.0)


def head_beats(rng, frames, peaks, strength):
    """Small pitch dips [T] on the agent's own stressed syllables."""
    out = np.zeros(frames)
    gain = rng.uniform(0.01, 0.05)
    for p, s in zip(peaks, strength):
        if rng.random() < 0.7:
            x = np.arange(frames) - p - 1
            lo, hi = max(0, p - 10), min(frames, p + 14)
            out[lo:hi] += gain * s * np.exp(-0.5 * (x[lo:hi] / 3.0) ** 2)
    return out


def head_angles(rng, head_pos, user, offset, root_yaw, own):
    """World yaw [T] (continuous), pitch [T] and roll [T] wanted of the head.

    head_pos [T, 3]: approximate head position; user [T, 3]: seen with a reaction delay of 0.17-0.3 s; own [T, 3]: what a real
    person's head adds (yaw, pitch, roll)."""
    frames = len(user)
    lag = int(rng.integers(5, 9))
    d = delay(user, lag) - head_pos
    flat = np.hypot(d[:, 0], d[:, 2])
    yaw = np.arctan2(d[:, 0], d[:, 2])
    base = np.asarray(root_yaw)
    rel = rig.wrap(yaw - base) + offset[:, 0]
    rel = np.clip(rel, -1.35, 1.35)                     # anatomical limit of head on feet (neck plus torso)
    pitch = np.clip(-np.arctan2(d[:, 1], np.maximum(flat, 0.3)) + offset[:, 1], -0.6, 0.75)
    target = base + rel
    yaw_out = follow(target, rng.uniform(9, 13), 6.5, 75.0)
    pitch_out = follow(pitch, rng.uniform(8, 11), 4.0, 50.0)
    return yaw_out + own[:, 0], pitch_out + own[:, 1], _tilts(rng, frames) + own[:, 2]


def _tilts(rng, frames):
    """Occasional head tilts held 1-4 s."""
    times, vals, t = [0], [0.0], int(FPS * rng.uniform(2, 8))
    while t < frames:
        a = rng.normal(0, 0.09)
        n = int(FPS * rng.uniform(1, 4))
        times += [t, t + 14, t + 14 + n, t + 28 + n]
        vals += [0.0, a, a, 0.0]
        t += n + 28 + int(FPS * rng.uniform(3, 12))
    return keyed(frames, times, vals)
