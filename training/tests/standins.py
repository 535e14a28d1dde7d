"""Small synthetic stand-ins for voices, people at rest and swings, for tests that need no recordings."""
import numpy as np

from visavis_train.corpus import rest, simulate, voices
from visavis_train.motion import rig


def fake_voices(seed=0):
    """Two speakers of syllable-like bursts: 24 kHz tones with 4 Hz amplitude modulation."""
    rng = np.random.default_rng(seed)
    out = {}
    for name, f0 in (("low", 110), ("high", 210)):
        phrases = []
        for _ in range(12):
            n = int(24000 * rng.uniform(0.5, 4))
            t = np.arange(n) / 24000
            amp = 0.2 * (0.15 + np.abs(np.sin(np.pi * 2.2 * t + rng.uniform(0, 3))) ** 2 * rng.uniform(0.5, 1))
            phrases.append(voices.Phrase(name, (amp * np.sin(2 * np.pi * f0 * t)).astype(np.float32)))
        out[name] = phrases
    return out


def standing_person(seed=0, frames=900, fold=False):
    """Positions and rotations of someone who stands, sways and shifts the arms once; `fold`: hands before the belly."""
    rng = np.random.default_rng(seed)
    t = np.arange(frames) / rig.FPS
    local = np.broadcast_to(np.eye(3), (frames, rig.J, 3, 3)).copy()
    lean = 0.02 * np.sin(2 * np.pi * t / rng.uniform(6, 9))
    local[:, rig.INDEX["spine"]] = rig.axis_mat("z", lean)
    local[:, rig.INDEX["upperChest"]] = rig.axis_mat("x", 0.015 * np.sin(2 * np.pi * t / rng.uniform(3.5, 4.5)))
    shift = 0.15 * (1 + np.tanh((t - t[-1] * rng.uniform(0.4, 0.6)) / 0.3))
    for side, sign in (("left", 1), ("right", -1)):
        local[:, rig.INDEX[side + "UpperArm"]] = rig.axis_mat("z", -sign * (1.35 - 0.4 * shift))
        bend = rig.axis_mat("y", -sign * (np.full(frames, 1.5 if fold else 0.35) + shift))
        local[:, rig.INDEX[side + "LowerArm"]] = bend
    g = rig.local_to_global(local)
    hips = np.stack([0.01 * np.sin(2 * np.pi * t / 7), np.full(frames, 0.915), 0 * t], 1)
    return rig.fk_global(hips, g), g


def fake_rests():
    rests = [rest.layers(*standing_person(s, fold=f)) for s, f in ((0, False), (1, True))]
    return rest.Library(["hanging", "hanging_mirror", "folded", "folded_mirror"], [rests[0], rests[0].mirror(), rests[1], rests[1].mirror()], np.ones(4))


def fake_sources():
    spots = np.random.default_rng(5).normal((0.05, -0.2, 0.3), 0.08, (50, 3))
    return simulate.Sources(fake_voices(), None, [], spots, np.zeros((0, 36, 3)), fake_rests(), [], None)
