"""Sounds by class: ESC-10's recordings, speech and crowds from the speech folders, music by FluidSynth, the others synthesised.

A recording, voice or synthesised piece is in one split only: of ESC-10 folds 1 to 3 are train, the recordings of fold 4 val and test in turn.
"""
import os
import subprocess
import tempfile

import numpy as np
from scipy.signal import butter, lfilter, resample_poly, sosfilt

from .. import wav
from ..corpus import voices
from .features import RATE

ESC = ("dog_bark", "baby_cry", "person_sneeze", "rooster", "rain", "sea_waves", "clock_tick", "helicopter", "chainsaw", "fire_crackling")
MADE = ("alarm", "shot", "glass", "phone", "knock")
CLASSES = ESC + MADE + ("music", "speech", "crowd", "silence")
# sound level at 1 m [dB], height above the floor [m], how many metres more it is away
LEVEL = {"dog_bark": 88, "baby_cry": 84, "person_sneeze": 78, "rooster": 86, "rain": 66, "sea_waves": 70, "clock_tick": 56, "helicopter": 98, "chainsaw": 98,
         "fire_crackling": 68, "alarm": 96, "shot": 122, "glass": 90, "phone": 74, "knock": 76, "music": 78, "speech": 66, "crowd": 84, "silence": 0}
HEIGHT = {"dog_bark": (0.3, 0.6), "helicopter": (4.0, 8.0), "rain": (2.5, 4.0), "alarm": (2.0, 2.6), "shot": (1.2, 1.6), "speech": (1.4, 1.7), "sea_waves": (0.0, 0.3),
          "person_sneeze": (1.3, 1.7), "crowd": (1.4, 1.7)}
FONT = "/usr/share/sounds/sf2/FluidR3_GM.sf2"          # MIT, package fluid-soundfont-gm
SEEDS = {"train": range(0, 40), "val": range(40, 46), "test": range(46, 54)}
SCALE, BEAT = (0, 2, 4, 5, 7, 9, 11), 480
CHORDS = ((0, 4, 5, 4), (0, 5, 3, 4), (5, 3, 0, 4), (0, 3, 4, 3), (0, 2, 3, 4), (5, 4, 3, 4))


def band(x, low, high):
    return sosfilt(butter(2, [low, high], "bandpass", fs=RATE, output="sos"), x)


def ring(freqs, falls, gains, seconds, rng):
    """Decaying tones: frequencies [Hz], times of fall by 60 dB, amplitudes."""
    t = np.arange(int(seconds * RATE)) / RATE
    return sum(g * np.exp(-6.9 * t / f60) * np.sin(2 * np.pi * f * t + p) for f, f60, g, p in zip(freqs, falls, gains, rng.uniform(0, 6.28, len(freqs))))


def alarm(rng):
    t = np.arange(5 * RATE) / RATE
    low, high, rate = rng.uniform(550, 900), rng.uniform(1000, 1800), rng.uniform(0.7, 3.5)
    kind = rng.integers(3)
    if kind == 2:
        return np.sign(np.sin(2 * np.pi * high * t)) * ((t * rate * 1.5) % 1 < 0.5) * 0.5 + 0.2 * np.sin(2 * np.pi * 2 * high * t) * ((t * rate * 1.5) % 1 < 0.5)
    phase = (t * rate) % 1
    shape = 2 * np.abs(phase - 0.5) if kind == 0 else (phase < 0.5).astype(float)
    wave = 2 * np.pi * np.cumsum(low + (high - low) * shape) / RATE
    return np.sin(wave) + 0.4 * np.sin(2 * wave) + 0.25 * np.sin(3 * wave)


def shot(rng):
    out = np.zeros(5 * RATE)
    at = 0
    for _ in range(rng.integers(1, 5)):
        n = int(RATE * rng.uniform(0.5, 1.0))
        t = np.arange(n) / RATE
        crack = rng.standard_normal(n) * np.exp(-t / rng.uniform(0.008, 0.02))
        boom = band(rng.standard_normal(n), 40, rng.uniform(250, 500)) * np.exp(-t / rng.uniform(0.08, 0.2)) * 3
        if at + n > len(out):
            break
        out[at:at + n] += crack + boom
        at += int(RATE * rng.uniform(0.25, 1.1))
    return out


def glass(rng):
    out = np.zeros(5 * RATE)
    hit = int(0.03 * RATE)
    out[:hit] += rng.standard_normal(hit) * np.linspace(1, 0, hit)
    for _ in range(rng.integers(15, 45)):
        n = rng.integers(3, 7)
        piece = ring(rng.uniform(2000, 9000, n), rng.uniform(0.05, 0.5, n), rng.uniform(0.1, 0.6, n), 0.6, rng)
        at = int(RATE * rng.gamma(1.2, 0.18))
        if at + len(piece) < len(out):
            out[at:at + len(piece)] += piece * np.exp(-at / RATE / 0.6)
    return out


def phone(rng):
    t = np.arange(5 * RATE) / RATE
    kind = rng.integers(3)
    if kind == 0:      # a bell
        n = ring(rng.uniform(900, 2600, 5), np.full(5, 0.3), rng.uniform(0.3, 1, 5), 0.05, rng)
        out = np.tile(n, 100)[:len(t)]
    elif kind == 1:    # two warbling tones
        a, b = rng.uniform(500, 900), rng.uniform(950, 1400)
        out = np.where((t * rng.uniform(12, 22)) % 1 < 0.5, np.sin(2 * np.pi * a * t), np.sin(2 * np.pi * b * t))
    else:              # a tune of short notes
        notes = 660 * 2 ** (rng.choice([0, 2, 4, 7, 9, 12], 8) / 12)
        step = rng.uniform(0.11, 0.2)
        k = (t / step).astype(int)
        fresh = (t / step) % 1
        out = np.sin(2 * np.pi * notes[k % 8] * t) * np.exp(-3 * fresh) + 0.3 * np.sin(4 * np.pi * notes[k % 8] * t) * np.exp(-4 * fresh)
    on, off = rng.uniform(0.8, 1.6), rng.uniform(0.5, 1.6)
    return out * ((t % (on + off)) < on)


def knock(rng):
    out, at = np.zeros(5 * RATE), 0
    freqs = rng.uniform(90, 900, 6)
    while at < 4.4 * RATE:
        for _ in range(rng.integers(2, 6)):
            piece = ring(freqs, rng.uniform(0.05, 0.2, 6), rng.uniform(0.3, 1, 6) / (1 + freqs / 400), 0.3, rng)
            piece[:60] += rng.standard_normal(60) * 0.6
            if at + len(piece) < len(out):
                out[at:at + len(piece)] += piece * rng.uniform(0.7, 1)
            at += int(RATE * rng.uniform(0.16, 0.32))
        at += int(RATE * rng.uniform(0.8, 2.0))
    return out


def variable(n):
    """A number as MIDI files write delays."""
    out = [n & 127]
    while n := n >> 7:
        out.insert(0, n & 127 | 128)
    return bytes(out)


def tune(rng, bars=4):
    """A MIDI file of drums, bass, chords and a melody, 90 to 140 beats a minute."""
    tempo, key = int(60e6 / rng.uniform(90, 140)), int(rng.integers(-5, 7))
    events = [(0, bytes([0xC0 + c, int(p)])) for c, p in ((0, rng.choice([0, 4, 5, 24, 25, 48, 80])), (1, rng.choice([33, 34, 36, 38])), (2, rng.choice([0, 11, 26, 56, 61, 65, 81])))]
    swing, chords = int(rng.choice([0, 0, 80])), CHORDS[rng.integers(len(CHORDS))]
    at = lambda degree, base: base + key + 12 * (degree // 7) + SCALE[degree % 7]

    def play(channel, time, length, pitch, force):
        events.extend([(int(time), bytes([0x90 + channel, pitch, int(force)])), (int(time + length), bytes([0x80 + channel, pitch, 0]))])

    for bar in range(bars):
        start, root = bar * 4 * BEAT, chords[bar % 4]
        for b in range(4):
            t = start + b * BEAT
            play(9, t, 60, 36 if b % 2 == 0 else 38, 110)
            for e in (0, BEAT // 2 + swing):
                play(9, t + e, 40, 42, 75)
            play(1, t, BEAT * 0.8, at(root, 36), 100)
            for d in (0, 2, 4):
                play(0, t + (BEAT // 2 if b % 2 else 0), BEAT * 0.6, at(root + d, 60), 75)
            for e in (0, BEAT // 2 + swing):
                if rng.random() < 0.7:
                    play(2, t + e, BEAT * 0.45, at(root + int(rng.choice([0, 1, 2, 4, 5, 7])), 72), 90)
    track, now = b"\x00\xff\x51\x03" + tempo.to_bytes(3, "big"), 0
    for t, message in sorted(events, key=lambda e: e[0]):
        track += variable(t - now) + message
        now = t
    track += b"\x00\xff\x2f\x00"
    return b"MThd" + (6).to_bytes(4, "big") + bytes([0, 0, 0, 1]) + BEAT.to_bytes(2, "big") + b"MTrk" + len(track).to_bytes(4, "big") + track


def music(rng):
    """Seven seconds of a tune, played by FluidSynth."""
    with tempfile.TemporaryDirectory() as folder:
        name = os.path.join(folder, "tune")
        with open(name + ".mid", "wb") as f:
            f.write(tune(rng))
        try:
            subprocess.run(["fluidsynth", "-ni", "-q", "-r", str(RATE), "-F", name + ".wav", FONT, name + ".mid"], check=True, capture_output=True)
        except FileNotFoundError as error:
            raise SystemExit("music needs the Debian packages fluidsynth and fluid-soundfont-gm") from error
        return wav.read(name + ".wav")[0][:7 * RATE].astype(np.float64)


def trimmed(y):
    """From the first stretch that is within 25 dB of the loudest; fades at both ends."""
    loud = voices.envelope(y, 240)
    first = int(np.flatnonzero(loud > loud.max() * 10 ** (-25 / 20))[0]) * 240
    y = y[max(0, first - 48):].copy()
    y[-480:] *= np.linspace(1, 0, min(480, len(y)))
    return y


def esc(data, name, split):
    """Recordings of a class: {file: samples}; clips that are padded with silence keep it."""
    import soundfile
    folder, out, tested = os.path.join(data, "sounds", "esc10", name), {}, {}
    for f in sorted(os.listdir(folder)):
        fold, recording = f.split("-")[:2]
        if fold == "4":
            place = ("val", "test")[tested.setdefault(recording, len(tested)) % 2]
        else:
            place = "train"
        if place == split:
            y, rate = soundfile.read(os.path.join(folder, f))
            g = np.gcd(rate, RATE)
            out[f"esc10/{name}/{f}"] = trimmed(resample_poly(y, RATE // g, rate // g))
    return out


class Sounds:
    """Sounds of a split, each at 1 Pa of its loudest tenth of a second (a twentieth of the time)."""

    def __init__(self, data, split):
        self.kept, self.split = {name: esc(data, name, split) for name in ESC}, split
        for name in MADE + ("music",):
            make = globals()[name]
            seeds = list(SEEDS[split])[:16 if name == "music" else None]
            self.kept[name] = {f"{name}/{seed}": trimmed(make(np.random.default_rng([seed, len(name)]))) for seed in seeds}
        self.voices = voices.load_voices(os.path.join(data, "speech"), split)

    def names(self, kind):
        return sorted(self.kept.get(kind, {"": None}))

    def spoken(self, rng, least=4.0):
        """Some seconds of one voice."""
        who = sorted(self.voices)[rng.integers(len(self.voices))]
        phrases = self.voices[who]
        at, parts = int(rng.integers(len(phrases))), []
        while sum(map(len, parts)) < least * RATE:
            parts += [phrases[at % len(phrases)].audio, np.zeros(int(RATE * rng.uniform(0.15, 0.5)))]
            at += 1
        return np.concatenate(parts)[:int(6 * RATE)].astype(np.float64), phrases[0].source

    def draw(self, rng, kind):
        """A sound [N] of about 94 dB and the name of what it was made from."""
        if kind == "speech":
            y, name = self.spoken(rng)
        elif kind == "crowd":
            y, name = np.zeros(5 * RATE), "crowd"
            for _ in range(rng.integers(8, 15)):
                v, name = self.spoken(rng, 5.2)
                v = resample_poly(v, 10, int(rng.integers(9, 14)))      # raised voices are higher
                v = np.roll(v, int(rng.integers(len(v))))[:len(y)]
                y[:len(v)] += v
            y = lfilter([1, -0.6], [1], y)
        else:
            name = self.names(kind)[rng.integers(len(self.names(kind)))]
            y = self.kept[kind][name]
        level = np.quantile(voices.envelope(y, 1200), 0.95)
        return y / max(level, 1e-6), name
