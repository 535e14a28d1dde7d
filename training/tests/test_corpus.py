"""The corpus from synthetic voices: plausible bodies, turn taking, the clip format. Needs no recordings."""
import os

import numpy as np
import pytest

from visavis_train.corpus import attention, check, feet, gestures, real, rest, signals, simulate, store, voices
from visavis_train.motion import rig

from standins import fake_rests, fake_sources, fake_voices

FRAMES = 1200


@pytest.fixture(scope="module", params=[0, 3, 7])
def clip(request):
    return simulate.simulate_clip(np.random.default_rng(request.param), FRAMES, fake_sources())


def test_feet_stay_on_and_above_the_floor(clip):
    toes = clip.positions[:, check.FEET]
    assert toes[..., 1].min() > -0.01
    assert clip.positions[:, [rig.INDEX["leftFoot"], rig.INDEX["rightFoot"]], 1].min() > 0.04
    assert check.support_speed(clip.positions).mean() < 0.02
    assert check.foot_slide(clip.positions).mean() < 0.35


def test_speeds_and_accelerations_are_human(clip):
    v = np.linalg.norm(np.diff(clip.positions, axis=0), axis=-1) * 30
    a = np.linalg.norm(np.diff(clip.positions, 2, axis=0), axis=-1) * 900
    assert v.max() < 7.0 and v[:, 0].max() < 2.0
    assert np.percentile(a, 99.9) < 90 and a.max() < 160
    q = rig.mat_to_quat(clip.rotations)
    turn = 2 * np.arccos(np.clip(np.abs(np.sum(q[1:] * q[:-1], -1)), 0, 1)) * 30
    assert turn.max() < 25


def test_bones_keep_their_length_and_arms_stay_out_of_the_trunk(clip):
    assert check.bone_error(clip.positions) < 1e-4
    assert np.allclose(rig.fk_global(clip.positions[:, 0], clip.rotations), clip.positions, atol=1e-9)
    assert check.trunk_depth(clip.positions, clip.rotations).max() < 0.06


def test_knees_bend_forward_and_hips_stay_high(clip):
    I = rig.INDEX
    for side in ("left", "right"):
        hip, knee, ankle = (clip.positions[:, I[side + n]] for n in ("UpperLeg", "LowerLeg", "Foot"))
        w = rig.unit(ankle - hip)
        out = knee - hip - np.sum((knee - hip) * w, -1, keepdims=True) * w
        assert np.mean(np.sum(out * clip.rotations[:, 0, :, 2], -1) > -0.01) > 0.97
    assert clip.positions[:, 0, 1].min() > 0.72


def test_same_seed_same_clip():
    src = fake_sources()
    a, b = (simulate.simulate_clip(np.random.default_rng(11), 600, src) for _ in range(2))
    assert np.array_equal(a.positions, b.positions) and np.array_equal(a.user, b.user)
    assert (a.agent_voice is None) == (b.agent_voice is None)


def test_gaze_follows_the_level():
    src = fake_sources()
    g = {}
    for q in (0.3, 0.97):                                  # quantiles: sustained contact, averted
        rows = [simulate.simulate_clip(np.random.default_rng(s), 900, src, q) for s in range(6)]
        g[q] = np.mean([rig.gaze_score(c.positions, c.rotations, c.user)[:300].mean() for c in rows])
    assert g[0.3] > 0.75 and g[0.97] < 0.55


def test_dialogue_alternates_and_both_voices_speak():
    d = voices.compose(np.random.default_rng(2), fake_voices(), 1800)
    assert d.agent.shape == d.user.shape == (1800 * 800,)
    talk = [attention.mask(p, 1800) for p in (d.agent_phrases, d.user_phrases)]
    assert 0.15 < talk[0].mean() < 0.85 and 0.15 < talk[1].mean() < 0.85
    assert (talk[0] & talk[1]).mean() < 0.25


def test_vad_finds_the_bursts():
    x = np.random.default_rng(0).normal(0, 1e-4, 24000 * 4).astype(np.float32)
    x[24000:48000] += 0.1 * np.sin(np.arange(24000) * 0.05).astype(np.float32)
    (a, b), = voices.vad(x)
    assert abs(a - 24000) < 3000 and abs(b - 48000) < 3000


def test_wrists_move_more_on_strokes():
    rng = np.random.default_rng(4)
    peaks = list(range(60, 860, 24))
    own, _, _ = rest.compose(rng, fake_rests(), 1800)
    arms = gestures.plan(rng, 1800, peaks, np.ones(len(peaks)), [(2, 29)], None, np.zeros((0, 36, 3)), 1.0, own, np.zeros(1800, bool))
    v = np.linalg.norm(np.diff(arms.wrist, axis=1), axis=-1).mean(0) * 30
    assert v[40:880].mean() > 3 * v[960:].mean()
    assert np.allclose(arms.wrist[:, 960:], own.wrist[960:].swapaxes(0, 1)), "strokes come back to the person's own rest pose"


def test_planted_feet_do_not_move():
    t = np.arange(600)
    root = np.stack([0.4 * np.sin(t / 90.0), 0.01 * t], 1)
    plan = feet.plan(np.random.default_rng(0), root, 0.3 * np.sin(t / 60.0))
    still = (plan.swing[1:] == 0) & (plan.swing[:-1] == 0)
    step = np.abs(np.diff(plan.toe, axis=0)).max(-1)
    assert step[still].max() < 0.03 and np.median(step[still]) == 0
    assert len(plan.steps) > 10 and not ((plan.swing[:, 0] > 0) & (plan.swing[:, 1] > 0)).any()


def test_chain_joins_without_a_jump():
    def walk(phase):
        t = np.arange(90) / 30
        g = np.broadcast_to(np.eye(3), (90, rig.J, 3, 3)).copy()
        g[:, rig.INDEX["leftUpperLeg"]] = rig.axis_mat("x", 0.4 * np.sin(6 * t + phase))
        g = rig.local_to_global(g)
        return rig.fk_global(np.stack([0 * t, 0 * t + 0.92, t], 1), g), g
    p, r = real.chain([walk(0.0), walk(1.0), walk(2.5)])
    assert len(p) > 150
    assert np.linalg.norm(np.diff(p, axis=0), axis=-1).max() * 30 < 6
    assert np.allclose(rig.fk_global(p[:, 0], r), p, atol=1e-9)


def test_store_round_trip_and_errors(tmp_path, clip):
    path = os.path.join(tmp_path, "a.safetensors")
    voice = np.zeros(800 * FRAMES, np.float32)
    store.save(path, clip.positions, clip.rotations, clip.user, voice, None, {"split": "train", "sources": ["x"]})
    c = store.load(path)
    assert c.user_voice is None and c.agent_voice.dtype == np.int16 and c.meta["sources"] == '["x"]'
    assert c.positions.dtype == np.float32 and check.bone_error(c.positions.astype(float)) < 1e-4
    assert np.abs(c.positions[0, 0, [0, 2]]).max() < 1e-5
    assert abs(rig.yaw_of(rig.quat_to_mat(c.rotations[:1, 0]))[0]) < 1e-5
    first = open(path, "rb").read()
    store.save(path, clip.positions, clip.rotations, clip.user, voice, None, {"sources": ["x"], "split": "train"})
    assert open(path, "rb").read() == first
    g0 = rig.gaze_score(clip.positions, clip.rotations, clip.user)
    assert np.allclose(rig.gaze_score(c.positions, rig.quat_to_mat(c.rotations), c.user_head), g0, atol=1e-4)
    store.save(path, clip.positions, clip.rotations, clip.user, voice[:-1], None, {})
    with pytest.raises(store.ClipError):
        store.load(path)


def test_splits_share_no_source():
    names = [n for s in ("train", "val", "test") for n in real.SIGNALS[s]] + [n for s in ("train", "val", "test") for n in real.TWO_PERSON[s]]
    assert len(names) == len(set(names))
    prefixes = [p for s in voices.SPLITS.values() for p in s]
    assert not any(a != b and a.startswith(b) for a in prefixes for b in prefixes)


def test_smooth_pieces():
    x = signals.keyed(100, [0, 50, 99], np.array([0.0, 1.0, 0.0]))
    assert x[50] == pytest.approx(1) and np.abs(np.diff(x)).max() < 0.05
    y = signals.follow(np.r_[np.zeros(5), np.ones(95)], 10.0, 6.0, 60.0)
    assert y[-1] == pytest.approx(1, abs=1e-3) and y.max() < 1.01
