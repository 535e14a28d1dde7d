"""The reaction model: features, ears, motion layout, table of reactions, schedule, network, bundle, training."""
import json
import os

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from visavis_train import bundle as bundles
from visavis_train.make_tiny import sway
from visavis_train.mospa import bundle, data, diffusion, ears, evaluate, extractor, features, goldens, layout, make_tiny, nets, react, sounds, train
from visavis_train.motion import features as poses
from visavis_train.motion import rig

GOLDENS = os.path.join(os.path.dirname(__file__), "..", "..", "tests", "goldens")


def against_librosa(y):
    """The features of an ear by librosa's own calls."""
    librosa = pytest.importorskip("librosa")
    t, at = len(y) // 800, {"sr": 24000, "hop_length": 800}
    p = np.abs(librosa.stft(y, n_fft=2048, hop_length=800, window="hann", center=True, pad_mode="constant")[:, :t]) ** 2
    mel = librosa.filters.mel(sr=24000, n_fft=2048, n_mels=128, dtype=np.float64)
    db = librosa.power_to_db(mel @ p, ref=1.0, amin=1e-10, top_db=80.0)
    mfcc, low = librosa.feature.mfcc(S=db, n_mfcc=20, dct_type=2, norm="ortho"), librosa.note_to_hz("C2")
    cq = librosa.pseudo_cqt(y, **at, fmin=low, n_bins=72, bins_per_octave=12, tuning=0.0, filter_scale=1, norm=1, sparsity=0.0, window="hann", scale=True,
                            pad_mode="constant", dtype=np.complex128)[:, :t]
    onset = librosa.onset.onset_strength(S=db, **at, n_fft=2048, lag=1, max_size=1, center=True, detrend=False)
    rms = librosa.feature.rms(y=y, frame_length=2048, hop_length=800, center=True, pad_mode="constant", dtype=np.float64)[:, :t]
    return np.concatenate([
        mfcc, librosa.feature.delta(mfcc, width=9, order=1, mode="interp"),
        librosa.feature.chroma_cqt(C=cq, **at, fmin=low, norm=np.inf, threshold=0.0, n_chroma=12, bins_per_octave=12),
        librosa.feature.chroma_stft(S=p, **at, n_fft=2048, norm=np.inf, tuning=0.0, n_chroma=12), onset[None],
        librosa.feature.tempogram(onset_envelope=onset, **at, win_length=64, center=True, window="hann", norm=np.inf),
        librosa.beat.beat_track(onset_envelope=onset, **at, start_bpm=120.0, tightness=100, trim=True, sparse=False)[1][None], rms, rms > 0.01]).T


def noises():
    rng = np.random.default_rng(0)
    clicks = np.zeros(96000)
    for at in range(0, 90000, 11000):
        clicks[at:at + 3000] += 0.3 * np.exp(-np.arange(3000) / 400) * rng.standard_normal(3000)
    yield clicks
    yield np.cumsum(rng.standard_normal(48000)) * 1e-4
    yield np.concatenate([np.zeros(20000), 0.2 * rng.standard_normal(4000), np.zeros(40000)])


def test_features_are_librosas():
    for y in noises():
        assert np.abs(features.ear(y) - against_librosa(y)).max() < 1e-5


def test_features_of_a_tone_silence_and_too_little():
    t = np.arange(48000) / 24000
    f = features.ear(0.1 * np.sin(2 * np.pi * 440 * t))[20:40]
    assert (f[:, 40:52].argmax(1) == 9).all() and (f[:, 52:64].argmax(1) == 9).all()      # an A
    assert np.allclose(f[:, 130], 0.1 / 2 ** 0.5, atol=1e-4) and (f[:, 131] == 1).all()
    quiet = features.ear(np.zeros(48000))
    assert np.isfinite(quiet).all() and (quiet[:, 40:] == 0).all()
    with pytest.raises(ValueError, match="at least 9"):
        features.ear(np.zeros(8 * 800))


def test_beats_fall_on_clicks():
    y = np.zeros(8 * 24000)
    for at in range(6000, len(y) - 500, 12000):          # 120 a minute: every 15 frames
        y[at:at + 500] = np.random.default_rng(1).standard_normal(500)
    assert set(np.diff(np.flatnonzero(features.ear(y)[:, 129]))) == {15}


def render(place, n=24000):
    room = ears.Room(np.full(3, -np.inf), np.full(3, np.inf), 0.0, 0.1, 0.0)
    y = np.zeros(n)
    y[100] = 0.5
    return ears.render(y, np.array(place), room, np.random.default_rng(0), noise_db=-200)


def test_the_nearer_ear_hears_first_and_more():
    left, right = render([2.0, 1.6, 0.0])
    lag = np.abs(right).argmax() - np.abs(left).argmax()
    assert abs(lag / 24000 - ears.RADIUS / ears.SOUND * (1 + np.pi / 2)) < 1.5 / 24000
    assert (left ** 2).sum() > 4 * (right ** 2).sum()
    left, right = render([0.0, 1.6, 2.0])
    assert np.allclose(left, right)
    assert 3.5 < (left ** 2).sum() / (render([0.0, 1.6, 4.0])[0] ** 2).sum() < 4.5           # half at twice the distance
    assert np.isfinite(render([0.0, 1.6, 0.0])).all()


def swaying(frames=240):
    p, q = poses.from_features(sway(frames).numpy())
    return p, rig.quat_to_mat(q)


def test_motion_goes_there_and_back():
    p, r = swaying()
    turn = rig.axis_mat("y", 0.7)
    moved, place = (p + [1, 0, 2]) @ turn.T, (np.array([1.0, 1, 3]) + [1, 0, 2]) @ turn.T
    x, there = layout.from_world(moved, turn @ r, place)
    plain, here = layout.from_world(p, r, [1.0, 1, 3])
    assert x.shape == (240, layout.SIZE) and np.abs(x - plain).max() < 1e-5 and np.allclose(there, here)
    assert np.abs(x[0, [0, 2]]).max() < 1e-6 and (x[0, layout.VELOCITIES] == 0).all()
    q, s = layout.to_world(x)
    assert np.abs(layout.from_world(q, s) - x).max() < 1e-4
    assert np.allclose(x[5, layout.VELOCITIES].reshape(-1, 3), q[5] - q[4], atol=1e-5)
    mirrored = layout.from_world(*rig.mirror(q, s))
    assert np.abs(layout.mirror(x) - mirrored).max() < 1e-5


def test_every_class_has_reactions_and_five_of_them_occur():
    assert set(react.TABLE) == set(sounds.CLASSES) == set(sounds.LEVEL) and len(sounds.CLASSES) > 10
    used = {r for row in react.TABLE.values() for r in row}
    assert used == set(react.REACTIONS) and all(len(row) == len(react.GENRES) for row in react.TABLE.values())
    seeds = [set(s) for s in sounds.SEEDS.values()]
    assert not seeds[0] & seeds[1] and not seeds[1] & seeds[2] and not seeds[0] & seeds[2]
    runs = [{n.split("/")[1].split("_")[0] for n in names} for names in react.RUNS.values()]
    assert not runs[0] & runs[1] and not runs[1] & runs[2] and not runs[0] & runs[2]


def test_a_body_walks_to_where_it_is_wanted():
    goal = np.array([2.0, -1.0])
    root, yaw, speed = react.walk([(30, None, 2.0, 1.0), (60, goal, 2.0, 1.2)], 4.0, 3.0)
    assert np.abs(root[:60]).max() < 0.01 and np.hypot(*(root[-1] - goal)) < 0.15 and abs(yaw[-1] - 2.0) < 0.05 and speed.max() < 1.4
    assert np.abs(np.diff(yaw)).max() * 30 < 3.01


def test_midi_is_a_file_with_its_events():
    raw = sounds.tune(np.random.default_rng(2))
    assert raw[:4] == b"MThd" and raw[14:18] == b"MTrk" and int.from_bytes(raw[18:22], "big") == len(raw) - 22 and raw.endswith(b"\xff\x2f\x00")
    assert sounds.variable(127) == b"\x7f" and sounds.variable(480) == b"\x83\x60"


def test_the_schedule_goes_from_clean_to_noise():
    a = diffusion.kept()
    assert a[0] > 0.9999 and a[-1] < 1e-6 and (a.diff() < 0).all()
    assert diffusion.times(4) == [249, 499, 749, 999] and diffusion.times(1000) == list(range(1000))
    with pytest.raises(ValueError, match="1 to 1000"):
        diffusion.times(0)


@pytest.mark.parametrize("steps", (1, 4, 50))
def test_sampling_with_a_perfect_net_gives_its_answer(steps):
    answer, asked = torch.randn(2, 6, 3), []

    def net(x, t, *_):
        asked.append(t[0].item())
        return answer
    assert torch.equal(diffusion.sample(net, torch.randn(2, 6, 3), steps, None, None, None), answer)
    assert asked == diffusion.times(steps)[::-1]


def tiny():
    return bundle.read(os.path.join(GOLDENS, "mospa.safetensors"))[0]


def inputs(net, n=2, seed=0):
    g = torch.Generator().manual_seed(seed)
    r = lambda *s: torch.randn(*s, generator=g)
    return r(n, net.frames, layout.SIZE), torch.tensor([700] * n), net.hear(r(n, net.frames, 132), r(n, net.frames, 132)), nets.source_row(r(n, 3), torch.ones(n)), torch.tensor([0, 2])[:n]


@torch.no_grad()
def test_every_input_is_heard():
    net = tiny()
    x, t, heard, row, genre = inputs(net)
    base = net(x, t, heard, row, genre)
    changed = heard.clone()
    changed[:, -1] += 1                                       # the last frame alone: it reaches the first
    for other in ((x + 0.1, t, heard, row, genre), (x, t - 300, heard, row, genre), (x, t, changed, row, genre), (x, t, heard, -row, genre), (x, t, heard, row, 0 * genre + 3)):
        assert (net(*other) - base)[:, 0].abs().max() > 1e-4
    assert torch.equal(nets.source_row(torch.tensor([[1.0, 2, 3]]), torch.zeros(1)), torch.zeros(1, 5))
    with pytest.raises(ValueError, match="patch must divide"):
        nets.Mospa(**make_tiny.SIZES | {"patch": 3})


def test_a_bundle_holds_the_network(tmp_path):
    tensors, settings = make_tiny.build()
    bundles.write(tmp_path / "b.safetensors", tensors, settings)
    net, got = bundle.read(tmp_path / "b.safetensors")
    assert got == settings and got["kind"] == "mospa" and all(torch.equal(v, tensors[k]) for k, v in bundle.tensors_of(net).items())
    assert load_file(os.path.join(GOLDENS, "mospa.safetensors")).keys() == tensors.keys()
    settings["kind"] = "dram"
    bundles.write(tmp_path / "c.safetensors", tensors, settings)
    with pytest.raises(ValueError, match="kind dram"):
        bundle.read(tmp_path / "c.safetensors")


def test_goldens_are_what_the_tiny_bundle_computes():
    kept, now = load_file(os.path.join(GOLDENS, "mospa.out.safetensors")), goldens.compute(tiny())
    assert kept.keys() == now.keys()
    for k in kept:
        assert (kept[k].double() - now[k].double()).abs().max() < 2e-4, k


def fake_corpus(folder, n=6):
    rng, (p, r) = np.random.default_rng(0), swaying()
    x = layout.from_world(p, r)
    x[:, 3:66] += np.linspace(-0.3, 0.3, 240)[:, None]            # something that every clip does
    for split in ("train", "val", "test"):
        place = folder / split
        place.mkdir(parents=True)
        np.save(place / "motion.npy", np.stack([x + 0.002 * rng.standard_normal(layout.SIZE) for _ in range(n)]).astype(np.float32))
        for ear in ("left", "right"):
            np.save(place / f"{ear}.npy", rng.standard_normal((n, 240, 132)).astype(np.float32))
        np.save(place / "location.npy", rng.standard_normal((n, 3)).astype(np.float32))
        names = sorted(react.TABLE)
        (place / "clips.json").write_text(json.dumps([{"class": names[i], "genre": react.GENRES[i % 3], "reaction": react.TABLE[names[i]][i % 3], "onset": 1.0, "begin": 0.2,
                                                       "sound": "alarm/1", "motion": ["reactidle/000_genuine"]} for i in range(n)]))


def run(monkeypatch, module, *argv):
    monkeypatch.setattr("sys.argv", [module.__name__, *map(str, argv)])
    module.main()


def test_mirror_images_of_clips(tmp_path):
    fake_corpus(tmp_path)
    split, net = data.Split(tmp_path, "train"), nets.Mospa(**nets.SIZES | {"width": 16, "heads": 2, "layers": 1})
    a, b = split.given(net, [1]), split.given(net, [7])
    assert torch.equal(a[0][..., :132], b[0][..., 132:]) and torch.equal(a[1] * torch.tensor([-1.0, 1, 1, 1, 1]), b[1]) and a[2] == b[2]
    assert np.allclose(layout.mirror(split.poses([7])), split.poses([1]))
    with pytest.raises(SystemExit, match="mospa.corpus makes them"):
        data.Split(tmp_path, "other")


def test_training_learns_resumes_and_exports(tmp_path, monkeypatch):
    from visavis_train.mospa import export
    fake_corpus(tmp_path / "c")
    sizes = ("--corpus", tmp_path / "c", "--width", 16, "--heads", 2, "--layers", 1, "--batch", 4, "--device", "cpu", "--lr", 1e-2)
    run(monkeypatch, train, *sizes, "--out", tmp_path / "whole.pt", "--steps", 30)
    log = [json.loads(line) for line in open(tmp_path / "whole.pt.jsonl")]
    net, state = train.load(tmp_path / "whole.pt")
    assert state["step"] == 30 and np.isfinite(log[-1]["val_500"])
    first = nets.Mospa(**state["sizes"])
    split = data.Split(tmp_path / "c", "val")
    for k in bundle.STATS:
        getattr(first, k).copy_(getattr(net, k))
    clean = net.standardise(torch.from_numpy(split.poses([0, 1])))
    off = lambda n: (n(torch.randn(2, 240, 264), torch.tensor([999, 999]), *split.given(n, [0, 1])) - clean)[..., 3:66].square().mean().item()
    assert off(net) < 0.95 * off(first)
    monkeypatch.setattr(train.Loop, "report", lambda self, *_: self.step == 12 and setattr(self, "asked", True))
    with pytest.raises(SystemExit):
        run(monkeypatch, train, *sizes, "--out", tmp_path / "parts.pt", "--steps", 30)
    monkeypatch.undo()
    run(monkeypatch, train, *sizes, "--out", tmp_path / "parts.pt", "--steps", 30, "--resume")
    again = train.load(tmp_path / "parts.pt")[0]
    assert all(torch.equal(a, b) for a, b in zip(net.parameters(), again.parameters()))
    sources = tmp_path / "d" / "sounds" / "esc10"
    sources.mkdir(parents=True)
    (sources / "ATTRIBUTION.tsv").write_text("file\tderived from\tby\tlicence\tsource\n")
    run(monkeypatch, export, "--corpus", tmp_path / "c", "--data", tmp_path / "d", "--net", tmp_path / "whole.pt", "--out", tmp_path / "b.safetensors")
    out, settings = bundle.read(tmp_path / "b.safetensors")
    assert "CMU" in settings["licence"].upper() and "RSAIT" in settings["licence"] and all(torch.equal(a, b) for a, b in zip(net.parameters(), out.parameters()))


def test_a_step_follows_the_motion_before_feet_and_way(tmp_path):
    fake_corpus(tmp_path)
    torch.manual_seed(0)
    split, net = data.Split(tmp_path, "train"), nets.Mospa(**nets.SIZES | {"width": 16, "heads": 2, "layers": 1})
    for name, value in split.statistics().items():
        getattr(net, name).copy_(value)
    given, clean = split.given(net, [0, 7, 2]), net.standardise(torch.from_numpy(split.poses([0, 7, 2])))
    torch.nn.init.normal_(net.out.weight, 0, 0.02)
    loss, parts = train.losses(net, net(torch.randn_like(clean), torch.tensor([999] * 3), *given), clean)
    flat = lambda of: torch.cat([g.flatten() for g in torch.autograd.grad(of, list(net.parameters()), retain_graph=True)])
    whole, plain = flat(loss), flat(parts["plain"])
    assert whole @ plain > 0.3 * whole.norm() * plain.norm() and whole.norm() < 5 * plain.norm()


def test_measures_tell_right_from_wrong():
    rng = np.random.default_rng(0)
    f = rng.standard_normal((40, 48))
    assert (evaluate.r_precision(f, f + 0.01, rng) == 1).all() and evaluate.r_precision(f, rng.standard_normal((40, 48)), rng)[0] < 0.15
    many = rng.standard_normal((400, 4))
    assert abs(evaluate.fid(many, many)) < 1e-6 and 3.5 < evaluate.fid(many, many + 1) < 4.5
    p, r = swaying()
    turn = rig.axis_mat("y", np.where(np.arange(240) > 60, 1.0, 0.0))
    x = layout.from_world(np.einsum("tab,tjb->tja", turn, p), turn[:, None] @ r)
    off, bearing, turned = evaluate.off_source(x, {"onset": 1.0}, np.array([3 * np.sin(1.0), 1, 3 * np.cos(1.0)]))
    assert off < 0.15 and bearing > 0.8 and turned > 0.8
    late = evaluate.reaction_time(x, {"onset": 1.5})
    assert abs(late - 0.5) < 0.1


def test_the_extractor_trains(tmp_path, monkeypatch):
    fake_corpus(tmp_path / "c")
    run(monkeypatch, extractor, "--corpus", tmp_path / "c", "--out", tmp_path / "e.pt", "--steps", 6, "--batch", 4, "--device", "cpu")
    net = extractor.load(tmp_path / "e.pt")
    split = data.Split(tmp_path / "c", "test")
    with torch.no_grad():
        assert net.of_motion(torch.from_numpy(split.poses([0, 1]))).shape == net.of_condition(*split.given(net.standard, [0, 1])).shape == (2, extractor.OUT)
