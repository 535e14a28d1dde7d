"""How lively a body is: stillness, speeds, changes of rest pose, sway, spectra, still stretches; nods of a listener.

Definitions: hands (wrists) and head relative to the hips, smoothed by a 9-frame Hann window, lengths scaled to a head
joint at 1.6 m (the rig's stands at 1.52 m). Both hands are *still* when slower than 3 cm/s. *Rest change*: the mean place of
a hand over 2 s moves by more than 10 cm from one such window to the next. *Sway*: sum of the standard deviations of
the hips over the feet, x and z of the hips' heading, in 30 s. *Still throughout*, *never*: share of stretches of 10 s of
which more than 0.95, less than 0.1 are still.
"""
import numpy as np

from ..motion import rig
from .signals import FPS, gaussian

HEAD_HEIGHT = 1.6
SCALE = HEAD_HEIGHT / rig.rest_positions()[rig.INDEX["head"], 1]
HANN = np.hanning(11)[1:-1] / np.hanning(11).sum()   # nine taps, none of them zero
STILL = 0.03
REST_WINDOW, SWAY_WINDOW, SPECTRUM = 2 * FPS, 30 * FPS, 256
SPELL, SHARES = 10 * FPS, (0.95, 0.1)                # stretches that are still nearly throughout, or nearly never
BANDS = (0.2, 0.5, 1.0, 2.0, 4.0, 8.0)               # edges of the spectra's bands [Hz]
QUANTILES = (0.25, 0.5, 0.75, 0.9)                   # of the still stretches' lengths
HANDS = [rig.INDEX["leftHand"], rig.INDEX["rightHand"]]
ANKLES = [rig.INDEX["leftFoot"], rig.INDEX["rightFoot"]]
HEAD = rig.INDEX["head"]
LEVEL_NAMES = ("stillness", "hand_speed", "hand_acceleration", "head_speed", "head_acceleration", "rest_changes", "sway", "still_stretches")


def smoothed(x):
    """Hann-smoothed [T, ...] with edges held."""
    pad = np.pad(x, ((4, 4),) + ((0, 0),) * (x.ndim - 1), mode="edge")
    return sum(w * pad[k: k + len(x)] for k, w in enumerate(HANN))


def _derivatives(x):
    """Speed and acceleration [T, ...] of smoothed points [T, ..., 3], central; 0 in the first and last frame."""
    v, a = np.zeros_like(x), np.zeros_like(x)
    v[1:] = np.diff(x, axis=0) * FPS
    a[1:-1] = np.diff(x, 2, axis=0) * FPS ** 2
    return np.linalg.norm(v, axis=-1), np.linalg.norm(a, axis=-1)


def runs(mask):
    """Runs of True: [(start, end)]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(mask, int), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def tracks(positions, rotations):
    """Per-frame quantities of one clip: hand and head speed and acceleration, hands [T, 2, 3] and hips over feet [T, 2]."""
    p = positions * SCALE
    rel = p[:, HANDS + [HEAD]] - p[:, :1]
    v, a = _derivatives(smoothed(rel))
    yaw = gaussian(np.unwrap(rig.yaw_of(rotations[:, 0])), 15)
    over = (p[:, 0] - p[:, ANKLES].mean(1))[:, [0, 2]]
    c, s = np.cos(yaw), np.sin(yaw)
    return {"hand_v": v[:, :2], "hand_a": a[:, :2], "head_v": v[:, 2], "head_a": a[:, 2], "hands": rel[:, :2],
            "over": np.stack([c * over[:, 0] - s * over[:, 1], s * over[:, 0] + c * over[:, 1]], 1)}


def _spectrum(x):
    """Power spectral density [SPECTRUM / 2 + 1] of one stretch: Hann window, mean taken out, one-sided, per Hz."""
    w = np.hanning(len(x) + 1)[:-1]
    power = np.abs(np.fft.rfft((x - x.mean()) * w)) ** 2 * 2 / (FPS * np.sum(w * w))
    return power


class Tally:
    """Sums over stretches of clips; `row` gives the measures. Means are per frame, per minute or per window as named."""

    def __init__(self):
        self.frames, self.still = 0, 0
        self.sums = {k: [] for k in ("hand_v", "hand_a", "head_v", "head_a")}
        self.changes, self.pairs = 0, 0
        self.sway, self.lengths, self.spells = [], [], []
        self.psd = {"hand": [], "head": []}

    def add(self, t, mask=None):
        """Adds the frames of `tracks` t under `mask` [T] bool (all by default)."""
        mask = np.ones(len(t["head_v"]), bool) if mask is None else mask
        inner = mask & (np.arange(len(mask)) > 0) & (np.arange(len(mask)) < len(mask) - 1)
        still = (t["hand_v"] < STILL).all(1)
        self.frames += int(inner.sum())
        self.still += int(still[inner].sum())
        for k, out in self.sums.items():
            out.append(t[k][inner].mean(1) if t[k].ndim > 1 else t[k][inner])
        for a, b in runs(mask):
            self.lengths += [(y - x) / FPS for x, y in runs(still[a:b])]
            self.spells += [float(still[i: i + SPELL].mean()) for i in range(a, b - SPELL + 1, SPELL)]
            n = (b - a) // REST_WINDOW
            if n > 1:
                m = t["hands"][a: a + n * REST_WINDOW].reshape(n, REST_WINDOW, 2, 3).mean(1)
                self.changes += int((np.linalg.norm(np.diff(m, axis=0), axis=-1) > 0.10).sum())
                self.pairs += n - 1
            for i in range(a, b - SWAY_WINDOW + 1, SWAY_WINDOW):
                self.sway.append(t["over"][i: i + SWAY_WINDOW].std(0).sum())
            for i in range(a, b - SPECTRUM + 1, SPECTRUM // 2):
                self.psd["hand"].append(_spectrum(t["hand_v"][i: i + SPECTRUM].mean(1)))
                self.psd["head"].append(_spectrum(t["head_v"][i: i + SPECTRUM]))

    def row(self):
        """Measures as a dict of floats and lists; NaN where nothing was long enough."""
        mean = lambda x: float(np.mean(x)) if len(x) else float("nan")
        cat = {k: np.concatenate(v) if v else np.zeros(0) for k, v in self.sums.items()}
        long = np.array([x for x in self.lengths if x >= 0.2])
        out = {"seconds": self.frames / FPS, "stillness": self.still / self.frames if self.frames else float("nan"),
               "hand_speed": mean(cat["hand_v"]), "hand_acceleration": mean(cat["hand_a"]),
               "head_speed": mean(cat["head_v"]), "head_acceleration": mean(cat["head_a"]),
               "rest_changes": self.changes / (self.pairs * REST_WINDOW / FPS / 60) if self.pairs else float("nan"),
               "sway": 100 * mean(self.sway),
               "still_seconds": [float(x) for x in np.quantile(long, QUANTILES)] if len(long) else []}
        out["still_throughout"] = float(np.mean([x > SHARES[0] for x in self.spells])) if self.spells else float("nan")
        out["still_never"] = float(np.mean([x < SHARES[1] for x in self.spells])) if self.spells else float("nan")
        out["still_stretches"] = len(long) / (self.frames / FPS / 60) if self.frames else float("nan")   # a minute, 0.2 s or longer
        for k, rows in self.psd.items():
            out[f"{k}_spectrum"] = bands(np.mean(rows, 0)) if rows else []
        return out


def bands(psd):
    """Root of the power in each of BANDS, m/s [len(BANDS) - 1]."""
    f = np.fft.rfftfreq(SPECTRUM, 1 / FPS)
    return [float(np.sqrt(psd[(f >= lo) & (f < hi)].sum() * f[1])) for lo, hi in zip(BANDS, BANDS[1:])]


def mean_row(tallies):
    """Row of several recordings, each with the same weight whatever its length."""
    rows = [t.row() for t in tallies]
    out = {"seconds": float(sum(r["seconds"] for r in rows))}
    for k in LEVEL_NAMES + ("head_acceleration", "still_throughout", "still_never"):
        got = np.array([r[k] for r in rows])
        out[k] = float(np.nanmean(got)) if not np.isnan(got).all() else float("nan")
    lengths = np.concatenate([[x for x in t.lengths if x >= 0.2] for t in tallies])
    weight = np.concatenate([np.full(sum(x >= 0.2 for x in t.lengths), 1 / max(t.frames, 1)) for t in tallies])
    order = np.argsort(lengths)
    share = np.cumsum(weight[order]) / weight.sum() if len(order) else np.zeros(0)
    out["still_seconds"] = [float(lengths[order][np.searchsorted(share, q)]) for q in QUANTILES] if len(order) else []
    for k in ("hand_spectrum", "head_spectrum"):
        got = [r[k] for r in rows if r[k]]
        out[k] = [float(x) for x in np.sqrt(np.mean(np.square(got), 0))] if got else []
    return out


def states(agent_phrases, user_phrases, frames, margin=2.0):
    """Masks [T] bool of a conversation: `speaking` the agent, `listening` the user alone, `idle` nobody within `margin` seconds."""
    from .attention import mask
    a, u = mask(agent_phrases, frames), mask(user_phrases, frames)
    k = np.ones(2 * int(margin * FPS) + 1)
    near = np.convolve((a | u).astype(float), k, "same") > 0.5
    return {"idle": ~near, "listening": u & ~a, "speaking": a}


# ---- nods ------------------------------------------------------------------------------------

def head_pitch(rotations):
    """Pitch of the head [T], rad, down positive."""
    f = rotations[:, HEAD, :, 2]
    return np.arctan2(-f[:, 1], np.hypot(f[:, 0], f[:, 2]))


def nods(pitch, least=0.035, fastest=0.12, slowest=0.60):
    """Frames at which a nod begins [N]: the head dips and comes back by at least `least` rad (2 degrees) each, down and up
    each in `fastest` to `slowest` seconds; dips that follow each other within 0.8 s are one nod."""
    x = gaussian(pitch - gaussian(pitch, 15), 1.0)
    turn = np.flatnonzero((np.diff(x)[:-1] * np.diff(x)[1:]) < 0) + 1
    out, last = [], -np.inf
    for a, b, c in zip(turn, turn[1:], turn[2:]):
        down, up = x[b] - x[a], x[b] - x[c]
        if down >= least and up >= least and all(fastest * FPS <= n <= slowest * FPS for n in (b - a, c - b)):
            if a - last > 0.8 * FPS:
                out.append(a)
            last = c
    return np.array(out, int)


def listener(pitch, agent_phrases, user_phrases, frames):
    """Nods of the agent: counts while the user speaks, in the user's pauses (up to 2 s after a phrase) and when nobody
    does, the seconds of each, and the lags [s] from the nearest end of a user's phrase (-1 to 2 s)."""
    from .attention import mask
    talk = np.zeros(frames, bool)
    for a, b in user_phrases:
        talk[int(a * FPS): int(b * FPS) + 1] = True
    agent = mask(agent_phrases, frames)
    pause = np.zeros(frames, bool)
    for _, b in user_phrases:
        pause[int(b * FPS) + 1: int((b + 2) * FPS)] = True
    states_ = {"user speaks": talk & ~agent, "user pauses": pause & ~talk & ~agent, "nobody": ~talk & ~pause & ~agent}
    at = nods(pitch)
    ends = np.array([b for _, b in user_phrases])
    lags = []
    for n in at:
        if len(ends) and not agent[n]:
            d = n / FPS - ends
            d = d[(d > -1) & (d < 2)]
            if len(d):
                lags.append(float(d[np.abs(d).argmin()]))
    return {k: (int(m[at].sum()), m.sum() / FPS) for k, m in states_.items()}, lags
