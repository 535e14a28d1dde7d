"""Real speech cut into phrases and composed into two-voice dialogues.

Turn taking: gaps between turns centred on +0.2 s with some overlap (Stivers et al. 2009; Heldner & Edlund 2010),
pauses within turns 0.2-0.9 s, backchannels of the listener at phrase ends (Yngve 1970; Ward & Tsukahara 2000).
"""
import os
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, fftconvolve, lfilter, resample_poly

from .. import wav

RATE = 24000
HOP = 800


@dataclass
class Phrase:
    """One stretch of speech of one speaker, 24 kHz float32 in -1..1."""
    source: str
    audio: np.ndarray


@dataclass
class Dialogue:
    """Two voices [800 T] float32 (None = absent) and their phrases as (start, end) in seconds."""
    agent: np.ndarray
    user: np.ndarray
    agent_phrases: list
    user_phrases: list
    sources: list


# Voices by split: no speaker of one split is heard in another.
SPLITS = {
    "train": ["ljspeech/", "ami/trn", "dyadic/agent.wav", "dyadic/agent1.wav", "dyadic/agent2.wav"],
    "val": ["ami/dev", "azure/aboutSpeechSdk.wav", "azure/speechService.wav", "azure/enrollment_audio_katie.wav"],
    "test": ["ami/tst", "azure/enrollment_audio_steve.wav", "dyadic/Auto_Repairs"],
}


def envelope(audio, hop=HOP):
    """RMS per hop, [len // hop]."""
    n = len(audio) // hop
    return np.sqrt(np.mean(audio[: n * hop].reshape(n, hop).astype(np.float64) ** 2, axis=1) + 1e-12)


def vad(audio, hop=240, min_gap=0.25, min_len=0.3):
    """Energy voice activity: (start, end) in samples; threshold between the noise floor and the loud level."""
    db = 20 * np.log10(envelope(audio, hop))
    floor, loud = np.percentile(db, 10), np.percentile(db, 95)
    active = db > max(floor + 0.4 * (loud - floor), loud - 32)
    out = []
    edges = np.flatnonzero(np.diff(np.concatenate([[0], active.astype(int), [0]])))
    for a, b in edges.reshape(-1, 2):
        if out and (a - out[-1][1]) * hop / RATE < min_gap:
            out[-1][1] = b
        else:
            out.append([a, b])
    pad = int(0.05 * RATE)
    return [(max(0, a * hop - pad), min(len(audio), b * hop + pad)) for a, b in out if (b - a) * hop / RATE >= min_len]


def read(path):
    """A wav file as 24 kHz mono float32, its loud parts at one level."""
    audio, sr = wav.read(path)
    g = np.gcd(int(sr), RATE)
    audio = resample_poly(audio, RATE // g, sr // g).astype(np.float32) if sr != RATE else audio
    loud = np.percentile(envelope(audio, 240), 90)
    return audio * np.float32(0.12 / max(loud, 1e-4))


def _single_speaker(rttm, name):
    """Stretches of one AMI excerpt in which exactly one speaker is annotated: (start, end, speaker)."""
    rows = [l.split() for l in open(rttm, encoding="utf-8", errors="replace")]
    turns = [(float(r[3]), float(r[3]) + float(r[4]), r[7]) for r in rows if len(r) > 7 and r[1] == name]
    cuts = sorted({c for a, b, _ in turns for c in (a, b)})
    out = []
    for a, b in zip(cuts, cuts[1:]):
        who = {s for x, y, s in turns if x < b and y > a}
        if len(who) == 1:
            s = who.pop()
            if out and out[-1][2] == s and abs(out[-1][1] - a) < 0.01:
                out[-1] = (out[-1][0], b, s)
            else:
                out.append((a, b, s))
    return [o for o in out if o[1] - o[0] > 0.5]


def load_voices(root, split):
    """Speakers of a split: {name: [Phrase, ...] in the order spoken}; `root` is the speech folder."""
    voices = {}
    for folder in sorted(os.listdir(root)):
        for f in sorted(os.listdir(os.path.join(root, folder))):
            rel = f"{folder}/{f}"
            if not f.endswith(".wav") or not any(rel.startswith(p) for p in SPLITS[split]):
                continue
            audio = read(os.path.join(root, rel))
            stem = f[:-4]
            if folder == "ami":
                for tag in ("train", "development", "test"):
                    for a, b, who in _single_speaker(os.path.join(root, "ami", f"debug.{tag}.rttm"), stem):
                        seg = audio[int(a * RATE): int(b * RATE)]
                        for x, y in vad(seg):
                            voices.setdefault("ami:" + who, []).append(Phrase(rel, seg[x:y]))
            else:
                who = {"ljspeech": "lj", "dyadic": stem, "azure": stem}[folder]
                if folder == "azure" and stem in ("aboutSpeechSdk", "speechService"):
                    who = "azure:monologue"
                for x, y in vad(audio):
                    voices.setdefault(who, []).append(Phrase(rel, audio[x:y]))
    voices = {k: v for k, v in voices.items() if sum(len(p.audio) for p in v) > 4 * RATE}
    if len(voices) < 2:
        raise FileNotFoundError(f"{root}: fewer than two speakers for split '{split}'; see the data folder's README for its layout")
    return voices


def load_pair(root):
    """The real two-channel call (agent, caller), 24 kHz; used in the test split only."""
    base = os.path.join(root, "dyadic", "Auto_Repairs_40_UTC_")
    return read(base + "agent.wav"), read(base + "caller.wav")


class _Speaker:
    """Walks through one speaker's phrases with one augmentation per clip (speed with pitch, gain, band, noise, room)."""

    def __init__(self, rng, phrases, is_user):
        self.rng, self.phrases = rng, phrases
        self.at = int(rng.integers(len(phrases)))
        self.ratio = [(1, 1), (20, 19), (19, 20), (12, 11), (11, 12), (9, 8), (8, 9)][rng.integers(7)]
        self.gain = 10 ** (rng.uniform(-9, 4) / 20)
        self.band = rng.uniform(2800, 3900) if rng.random() < 0.15 else None
        self.noise = 0.12 * self.gain * 10 ** (-rng.uniform(22, 50) / 20) if rng.random() < (0.7 if is_user else 0.25) else 0.0
        self.room = None
        if rng.random() < (0.35 if is_user else 0.1):
            n = int(RATE * rng.uniform(0.15, 0.4))
            tail = rng.standard_normal(n) * np.exp(-6.9 * np.arange(n) / n) * rng.uniform(0.01, 0.03)
            tail[0] = 1.0
            self.room = tail.astype(np.float32)
        self.used = set()

    def next(self, max_s=8.0, short=False):
        r = self.rng
        if short:
            small = [i for i, p in enumerate(self.phrases) if len(p.audio) < 0.9 * RATE]
            if small:
                ph = self.phrases[small[r.integers(len(small))]]
                audio = ph.audio
            else:
                ph = self.phrases[r.integers(len(self.phrases))]
                audio = ph.audio[: int(RATE * r.uniform(0.35, 0.6))].copy()
        else:
            if r.random() < 0.15:
                self.at = int(r.integers(len(self.phrases)))
            ph = self.phrases[self.at % len(self.phrases)]
            self.at += 1
            audio = ph.audio[: int(max_s * RATE)]
        self.used.add(ph.source)
        up, down = self.ratio
        audio = resample_poly(audio, up, down).astype(np.float32) if up != down else audio.copy()
        fade = min(len(audio) // 4, 480)
        ramp = np.linspace(0, 1, fade, dtype=np.float32)
        audio[:fade] *= ramp
        audio[-fade:] *= ramp[::-1]
        return audio * np.float32(self.gain)

    def finish(self, track):
        if self.room is not None:
            track = fftconvolve(track, self.room)[: len(track)].astype(np.float32)
        if self.band:
            b, a = butter(3, self.band / (RATE / 2))
            track = lfilter(b, a, track).astype(np.float32)
        if self.noise:
            track = track + self.noise * self.rng.standard_normal(len(track)).astype(np.float32)
        return np.clip(track, -1, 1).astype(np.float32)


def compose(rng, voices, frames, talk_share=0.5):
    """Dialogue of `frames` frames between two speakers drawn from `voices`; `talk_share`: the agent's share of turns' length."""
    names = sorted(voices)
    weight = np.sqrt([sum(len(p.audio) for p in voices[n]) for n in names])
    pick = rng.choice(len(names), 2, replace=False, p=weight / weight.sum())
    who = [_Speaker(rng, voices[names[i]], k == 1) for k, i in enumerate(pick)]
    n = frames * HOP
    track = [np.zeros(n, np.float32), np.zeros(n, np.float32)]
    phrases = [[], []]

    def put(k, at, audio):
        a = int(max(0, at) * RATE)
        b = min(n, a + len(audio))
        if b > a:
            track[k][a:b] += audio[: b - a]
            phrases[k].append((a / RATE, b / RATE))
        return (a + len(audio)) / RATE

    t, total = rng.uniform(0.1, 2.5), n / RATE
    k = int(rng.random() < 0.5)
    while t < total:
        share = talk_share if k == 0 else 1 - talk_share
        end_turn = t + rng.gamma(2.2, 5.5 * share + 0.6)
        while True:
            t = put(k, t, who[k].next())
            if t < total and rng.random() < 0.3:  # backchannel of the listener around the phrase end
                put(1 - k, t + rng.uniform(-0.25, 0.3), who[1 - k].next(short=True) * np.float32(0.7))
            if t > end_turn or t > total:
                break
            t += min(0.15 + rng.gamma(2.0, 0.16), 1.0)
        r = rng.random()
        t += rng.uniform(8.0, 30.0) if r < 0.04 else rng.uniform(1.5, 4.5) if r < 0.12 else np.clip(rng.normal(0.2, 0.25), -0.45, 1.2)
        k = 1 - k
    for p in phrases:
        p.sort()
    out = [w.finish(tr) for w, tr in zip(who, track)]
    return Dialogue(out[0], out[1], phrases[0], phrases[1], sorted(who[0].used | who[1].used))


def cut_pair(rng, pair, frames):
    """A stretch of the real call, roles as they are or exchanged."""
    a, b = pair if rng.random() < 0.5 else pair[::-1]
    n = frames * HOP
    at = int(rng.integers(0, max(1, min(len(a), len(b)) - n)))
    seg = [np.pad(x[at: at + n], (0, max(0, n - len(x[at: at + n])))).astype(np.float32) for x in (a, b)]
    ph = [[(x / RATE, y / RATE) for x, y in vad(s)] for s in seg]
    return Dialogue(np.clip(seg[0], -1, 1), np.clip(seg[1], -1, 1), ph[0], ph[1], ["dyadic/Auto_Repairs_40_UTC"])


def loudness(audio):
    """Per-frame loudness 0..1 [T]: RMS in dB mapped from 35 dB below the 95th percentile of the active part."""
    e = 20 * np.log10(envelope(audio) + 1e-6)
    top = np.percentile(e[e > e.max() - 35], 90)
    return np.clip((e - top + 30) / 30, 0, 1.15)


def stress_peaks(level, phrases, min_gap=0.35):
    """Prosodic peaks: frames of local maxima of smoothed loudness within phrases, strongest first kept, and their strength."""
    from .signals import FPS, gaussian
    s = gaussian(level, 1.6)
    slow = gaussian(level, 12)
    score = s + 0.8 * (s - slow)
    active = np.zeros(len(s), bool)
    for a, b in phrases:
        active[int(a * FPS): int(b * FPS) + 1] = True
    loc = np.flatnonzero((s[1:-1] >= s[:-2]) & (s[1:-1] > s[2:]) & active[1:-1]) + 1
    kept = []
    for i in loc[np.argsort(-score[loc], kind="stable")]:
        if all(abs(i - j) >= min_gap * FPS for j in kept) and score[i] > 0.45:
            kept.append(int(i))
    kept.sort()
    return kept, score[kept] if kept else np.zeros(0)
