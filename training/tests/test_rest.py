"""People at rest: layers and joins, measures of liveliness, nods, swings, gestures; with the recordings where they are."""
import json
import os

import numpy as np
import pytest
from standins import fake_rests, fake_voices, standing_person

from visavis_train import credits
from visavis_train.corpus import attention, build, converse, feet, measures, people, real, rest, simulate, store, swings
from visavis_train.motion import bvh, npz, rig

DATA = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "..", "shared", "data")
needs_data = pytest.mark.skipif(not os.path.isdir(os.path.join(DATA, "motion", "reactidle")), reason="../shared/data is absent: no recordings of real people")


def walker(frames=240, step=0.6, period=32):
    """Someone who walks straight on along +Z: each foot stands half of the time and swings, lifted by 8 cm."""
    t = np.arange(frames)
    p = np.tile(rig.rest_positions(), (frames, 1, 1))
    g = np.broadcast_to(np.eye(3), (frames, rig.J, 3, 3)).copy()
    p[..., 2] += (2 * step / period * t)[:, None] * 0.5
    for f, (foot, toes) in enumerate(swings.FEET):
        u = (t / period + 0.5 * f) % 1.0
        s = np.clip((u - 0.5) / 0.5, 0, 1)
        z = step * (np.floor(t / period + 0.5 * f) + s * s * (3 - 2 * s))
        y = 0.08 * np.sin(np.pi * s) ** 2
        for j, off in ((foot, 0.0), (toes, rig.OFFSETS[rig.INDEX["leftToes"], 2])):
            p[:, rig.INDEX[j], 2] = z + off
            p[:, rig.INDEX[j], 1] = (rig.ANKLE_HEIGHT if off == 0 else rig.TOE_HEIGHT) + y
    return p, g


def moving_hands(speed, frames=900):
    """A body whose wrists go up at `speed` m/s (as measured: on a head at 1.6 m) for the middle third."""
    p = np.tile(rig.rest_positions(), (frames, 1, 1))
    way = np.clip(np.arange(frames) - frames // 3, 0, frames // 3) / rig.FPS * speed / measures.SCALE
    p[:, measures.HANDS, 1] += way[:, None]
    return p, np.broadcast_to(np.eye(3), (frames, rig.J, 3, 3)).copy()


def row(p, r):
    t = measures.Tally()
    t.add(measures.tracks(p, r))
    return t.row()


def test_stillness_and_speed_are_what_was_put_in():
    got = row(*moving_hands(0.06))
    assert got["stillness"] == pytest.approx(2 / 3, abs=0.01)
    assert got["hand_speed"] == pytest.approx(0.02, abs=5e-4)
    assert got["head_speed"] == 0 and got["sway"] == 0
    assert row(*moving_hands(0.02))["stillness"] == 1.0
    assert got["still_stretches"] == pytest.approx(2 / 0.5, rel=0.02)
    assert row(*moving_hands(0.06))["rest_changes"] > 0 == row(*moving_hands(0.01))["rest_changes"]


def test_rest_changes_count_hands_that_moved_by_ten_centimetres():
    p, r = moving_hands(0.0)
    p[450:, measures.HANDS[0], 2] += 0.2 / measures.SCALE
    t = measures.Tally()
    t.add(measures.tracks(p, r))
    assert t.changes in (1, 2)                                # one move, seen in the windows before and after it
    q, _ = moving_hands(0.0)
    q[450:, measures.HANDS[0], 2] += 0.08 / measures.SCALE
    assert row(q, r)["rest_changes"] == 0


def test_sway_and_spectrum_of_a_sine():
    p, r = moving_hands(0.0, 1800)
    t = np.arange(1800) / rig.FPS
    upper = [j for j in range(rig.J) if not any(k in rig.NAMES[j] for k in ("Foot", "Toes"))]
    p[:, upper, 0] += (0.05 / measures.SCALE * np.sin(2 * np.pi * 0.2 * t))[:, None]
    assert row(p, r)["sway"] == pytest.approx(5 / np.sqrt(2), rel=0.02)
    q, _ = moving_hands(0.0, 1800)
    q[:, measures.HANDS, 1] += (0.02 * np.sin(2 * np.pi * 0.75 * t))[:, None]    # |speed| swings at 1.5 Hz
    spectrum = row(q, r)["hand_spectrum"]
    assert np.argmax(spectrum) == 2 and spectrum[2] > 5 * max(spectrum[0], spectrum[4])


def test_mean_row_gives_every_recording_the_same_weight():
    tallies = []
    for speed, frames in ((0.06, 900), (0.0, 1800)):
        t = measures.Tally()
        t.add(measures.tracks(*moving_hands(speed, frames)))
        tallies.append(t)
    assert measures.mean_row(tallies)["stillness"] == pytest.approx((2 / 3 + 1) / 2, abs=0.01)


def test_layers_put_a_standing_person_back_where_it_was():
    p, g = standing_person(3)
    layer = rest.layers(p, g)
    chest = g[:, rig.INDEX["upperChest"]]
    for s, side in enumerate(("left", "right")):
        polar = [1 if s == 0 else -1, 1, 1]
        want = np.einsum("tba,tb->ta", chest, p[:, rig.INDEX[side + "Hand"]] - p[:, rig.INDEX[side + "UpperArm"]]) * polar
        assert np.abs(layer.wrist[:, s] - rest.clear_trunk(want[:, None])[:, 0])[10:-10].max() < 0.02
    back = layer.mirror().mirror()
    for name in ("hips", "chest", "wrist", "elbow", "head", "spine", "shoulder", "pelvis"):
        assert np.allclose(getattr(back, name), getattr(layer, name))


def test_change_overs_are_as_calm_as_the_rest():
    rng, at, off = np.random.default_rng(0), [], []
    library = fake_rests()
    for _ in range(6):
        layer, joins, used = rest.compose(rng, library, 2700)
        assert len(layer) == 2700 and len(used) == len(joins) + 1
        a = np.linalg.norm(np.diff(layer.wrist, 2, axis=0), axis=-1).mean(1) * rig.FPS ** 2
        mask = np.zeros(len(a), bool)
        for x, y in joins:
            mask[x:y] = True
        at.append(a[mask]), off.append(a[~mask])
    at, off = np.concatenate(at), np.concatenate(off)
    assert len(at) and at.max() < 1.2 * rest.GENTLE + off.max()
    assert np.linalg.norm(np.diff(layer.wrist, axis=0), axis=-1).max() * rig.FPS < 1.5


def test_compose_starts_with_the_recording_of_the_quantile():
    library = fake_rests()
    for q, name in ((0.1, "hanging"), (0.3, "hanging_mirror"), (0.6, "folded"), (0.99, "folded_mirror")):
        assert rest.compose(np.random.default_rng(1), library, 300, q)[2][0] == name


def test_swings_of_a_walk_are_found_and_replayed():
    library = swings.gather([walker()])
    assert library is not None and len(library.what) >= 6
    assert np.allclose(library.what[:, 0], 0.6, atol=0.05) and np.abs(library.what[:, 1:3]).max() < 0.05
    assert 0.05 < library.height.max() < 0.09
    curves = library.curves(0, np.linspace(0, 1, 40))
    assert abs(curves[0, 0]) < 1e-6 and curves[-1, 0] == pytest.approx(1) and np.diff(curves[:, 0]).min() > -0.02
    root = np.stack([np.zeros(300), np.clip(np.arange(300) - 60, 0, 150) * 0.02], 1)
    plan = feet.plan(np.random.default_rng(0), root, np.zeros(300), library)
    assert len(plan.steps) >= 4
    still = (plan.swing[1:] == 0) & (plan.swing[:-1] == 0)
    assert np.abs(np.diff(plan.toe, axis=0)).max(-1)[still].max() < 0.03
    assert plan.toe[..., 1].min() >= rig.TOE_HEIGHT - 1e-9


def conversation(seconds=110, seed=0):
    rng, out, t = np.random.default_rng(seed), [], 1.0
    while t < seconds:
        n = rng.uniform(1, 5)
        out.append((t, t + n))
        t += n + rng.uniform(0.4, 2)
    return out


def test_nods_come_at_a_listeners_rate_shortly_after_phrase_ends():
    frames, count, seconds, lags = 3600, 0, 0.0, []
    for seed in range(30):
        phrases = conversation(seed=seed)
        pitch = attention.nods(np.random.default_rng(seed), frames, phrases, np.zeros(frames, bool))
        got, lag = measures.listener(pitch, [], phrases, frames)
        count += sum(n for n, _ in got.values())
        seconds += sum(s for k, (_, s) in got.items() if k != "nobody")
        lags += lag
        assert got["nobody"][0] == 0
    assert 4 < 60 * count / seconds < 12
    assert 0.05 < np.median(lags) < 0.45


def test_nods_are_counted_and_nothing_else_is():
    t = np.arange(900) / rig.FPS
    nod = np.where((t > 10) & (t < 11), 0.10 * 0.5 * (1 - np.cos(2 * np.pi * 2 * (t - 10))), 0.0)
    assert len(measures.nods(nod)) == 1 and abs(measures.nods(nod)[0] - 300) < 6
    assert len(measures.nods(0.3 * np.sin(2 * np.pi * 0.1 * t))) == 0          # slow looking up and down
    assert len(measures.nods(np.where(t > 10, 0.3, 0.0))) == 0                 # looks down and stays there
    assert len(measures.nods(0.2 * nod)) == 0


def pieces():
    layer = rest.layers(*standing_person(5))
    out = []
    for kind in ("shrug", "question", "think", "talk", "plead", "refuse", "dismiss", "nod", "shake"):
        part = layer.cut(300, 390)
        t = np.arange(90) / 90
        part.wrist[:, :, 2] += (0.2 * np.sin(np.pi * t) ** 2)[:, None]
        part.head[:, 1] += 0.1 * np.sin(np.pi * t) ** 2
        out.append(converse._piece(kind, part))
    return out


def test_gestures_leave_the_rest_pose_and_come_back_to_it():
    rng = np.random.default_rng(0)
    layer, _, _ = rest.compose(rng, fake_rests(), 2400)
    agent, user = [(2.0, 6.0), (6.5, 9.0), (30.0, 34.0), (34.5, 38.0)], [(12.0, 20.0), (45.0, 50.0)]
    taken = heard = 0
    for seed in range(20):
        out, head, busy = converse.perform(np.random.default_rng(seed), layer, pieces(), agent, user, list(range(60, 1140, 20)), np.ones(54), 1.0)
        assert np.allclose(out.wrist[~busy], layer.wrist[~busy]) and np.allclose(np.linalg.norm(out.elbow, axis=-1), 1)
        v = np.linalg.norm(np.diff(out.wrist, axis=0), axis=-1) * rig.FPS
        assert v.max() < 4.0
        edges = np.flatnonzero(np.diff(busy.astype(int)))
        assert v[edges].max(initial=0) < 0.2 + np.linalg.norm(np.diff(layer.wrist, axis=0), axis=-1).max() * rig.FPS
        taken += busy.any()
        heard += np.abs(head[360:700]).max() > 0.01
    assert taken > 10 and heard > 0


def test_a_split_without_gestures_gets_none_and_people_are_in_one_split():
    assert converse.load("nowhere", "test") == []
    persons = {s: {n.split("/")[1][:3] if "react" in n else n.split("/")[0] for n in rest.TAKES[s]} for s in rest.TAKES}
    assert not (persons["train"] & persons["val"] or persons["train"] & persons["test"] or persons["val"] & persons["test"])


def test_a_missing_recording_is_named():
    with pytest.raises(FileNotFoundError, match="000_genuine"):
        rest.take("nowhere", "reactidle/000_genuine")


def make_npz(path, **change):
    arrays = {"names": np.array(["root", "a"]), "parents": np.array([-1, 0]), "offsets": np.zeros((2, 3)), "rot": np.tile([1.0, 0, 0, 0], (5, 2, 1)),
              "root": np.zeros((5, 3)), "fps": np.array(30.0)} | change
    np.savez(path, **{k: v for k, v in arrays.items() if v is not None})
    return str(path)


def test_npz_reader(tmp_path):
    quarter = np.tile([np.sqrt(0.5), 0, 0, np.sqrt(0.5)], (5, 2, 1))                          # w first: 90 degrees about Z
    clip = npz.read_npz(make_npz(tmp_path / "a.npz", rot=quarter))
    assert clip.dt == pytest.approx(1 / 30) and np.allclose(clip.local[0, 0] @ [1, 0, 0], [0, 1, 0])
    (tmp_path / "text.npz").write_text("no archive")
    bad = [make_npz(tmp_path / "b.npz", fps=None), make_npz(tmp_path / "c.npz", root=np.zeros((4, 3))), make_npz(tmp_path / "d.npz", parents=np.array([-1, 1])),
           make_npz(tmp_path / "e.npz", rot=np.full((5, 2, 4), np.nan)), make_npz(tmp_path / "f.npz", fps=np.array(0.0)), str(tmp_path / "text.npz")]
    for path in bad:
        with pytest.raises(bvh.MotionFormatError):
            npz.read_npz(path)


def test_credits_name_what_the_clips_name(tmp_path):
    p, g = standing_person(0, 60)
    save = lambda name, sources: store.save(str(tmp_path / name), p, g, p[:, 5], None, None, {"sources": sources})
    assert credits.licence(str(tmp_path)) == "Weights made from the trainer's own recordings."
    save("a.safetensors", ["reactidle/007_genuine", "ljspeech/x.wav"])
    text = credits.licence(str(tmp_path))
    assert "RSAIT" in text and "mocap.cs.cmu.edu" in text and "LJ Speech" in text and "ACCAD" not in text
    save("b.safetensors", ["accad_female1/Female1_A04_Look", "rocketbox/f_idle_neutral_01"])
    text = credits.licence(str(tmp_path))
    assert "CC BY 3.0" in text and "Microsoft Rocketbox" in text


def test_phrases_are_those_of_the_metadata_or_found_in_the_voice(tmp_path):
    p, g = standing_person(0, 300)
    voice = np.zeros(300 * 800, np.float32)
    burst = fake_voices()["low"][0].audio[:24000 * 2]
    voice[48000: 48000 + len(burst)] = burst
    path = str(tmp_path / "a.safetensors")
    store.save(path, p, g, p[:, 5], voice, None, {"agent_phrases": [[1.0, 2.0]]})
    assert people.phrases(store.load(path), "agent") == [(1.0, 2.0)]
    store.save(path, p, g, p[:, 5], voice, None, {})
    (a, b), = people.phrases(store.load(path), "agent")
    assert abs(a - 2.0) < 0.2 and people.phrases(store.load(path), "user") == []


@needs_data
def test_real_people_rest_as_published():
    got = people.real_rows(DATA)["idle"]
    # measured elsewhere on these recordings' own skeletons: stillness 0.56, hands 0.060 m/s, 4.5 changes a minute, sway 2.8 cm
    assert got["stillness"] == pytest.approx(0.56, abs=0.06)
    assert got["hand_speed"] == pytest.approx(0.060, abs=0.015)
    assert got["rest_changes"] == pytest.approx(4.5, abs=1.0)
    assert got["sway"] == pytest.approx(2.8, abs=1.0)


@needs_data
def test_idle_stretches_rest_like_real_people():
    real_row = people.real_rows(DATA)["idle"]
    src = simulate.Sources(fake_voices(), None, [], None, np.zeros((0, 36, 3)), rest.load(DATA, "train"), [], None)
    t, at, off = measures.Tally(), [], []
    for i in range(40):
        clip, _ = build.talk((0, 0, 2, 8 * i + 3), 2400, src, (0.35 + 8 * i * 0.618) % 1, (0.5 + i * 0.7548776662) % 1, True)
        t.add(measures.tracks(clip.positions, clip.rotations), people.stands(clip.user))
        at.append(people.join_accelerations(clip.positions, clip.joins, True))
        off.append(people.join_accelerations(clip.positions, clip.joins, False))
    got = t.row()
    for k in ("stillness", "hand_speed", "hand_acceleration", "head_speed", "rest_changes", "sway"):
        assert got[k] == pytest.approx(real_row[k], rel=0.3), k    # 20 % is asked of a whole corpus, these are 53 minutes
    assert np.concatenate(at).mean() < 1.2 * np.concatenate(off).mean()


@needs_data
def test_swings_and_gestures_of_real_people():
    library = real.swing_library(DATA, "train")
    assert len(library.what) > 200 and np.percentile(library.height.max(1), 50) == pytest.approx(0.06, abs=0.03)
    kinds = {p.kind for p in converse.load(DATA, "train")}
    assert kinds == {"shrug", "shake", "nod", "plead", "refuse", "think", "question", "dismiss", "talk"}
    nod = next(p for p in converse.load(DATA, "train") if p.kind == "nod")
    assert len(measures.nods(np.concatenate([np.zeros(60), nod.head[:, 1], np.zeros(60)]))) >= 1


def test_metadata_that_is_written_can_be_read(tmp_path):
    p, g = standing_person(0, 60)
    path = str(tmp_path / "a.safetensors")
    store.save(path, p, g, p[:, 5], None, None, {"joins": [(3, 9)], "agent_phrases": build._seconds([(np.float64(0.1), 1.23456)])})
    meta = store.load(path).meta
    assert json.loads(meta["joins"]) == [[3, 9]] and json.loads(meta["agent_phrases"]) == [[0.1, 1.235]]
