"""The classifier of generated motion, and what rests weigh."""
import sys

import numpy as np
import pytest
import torch

from visavis_train import make_tiny
from visavis_train.corpus import store
from visavis_train.motion import features, rig
from visavis_train.nets.stream import Sampler
from visavis_train.train import student, tell


def bodies(count, frames=240):
    """A swaying body at `count` phases: features [N, T, F] in metres."""
    x = make_tiny.sway(frames + 7 * count)
    return torch.stack([x[7 * i: 7 * i + frames] for i in range(count)])


def windows(x):
    return tell.windows(tell.seen(x))


def test_windows_begin_every_half_second():
    x = torch.arange(150.0).reshape(1, 150, 1)
    w = tell.windows(x)
    assert w.shape == (1, 7, tell.FRAMES, 1) and w[0, 1, 0, 0] == tell.STRIDE


def test_fidgeting_is_told_and_the_same_motion_is_not():
    x, half = bodies(6), torch.arange(6) % 2 == 1
    shaking = x + 0.02 * torch.randn(x.shape, generator=torch.Generator().manual_seed(0))
    told = tell.told(windows(x), windows(shaking), half, steps=60, nets=1)
    same = tell.told(windows(x), windows(x), half, steps=60, nets=1)
    assert told.shape == windows(x).shape[:2]
    other = tell.told(windows(x), windows(x[tell.others(list("aabbcd"), half)]), half, steps=60, nets=1)
    assert told.mean() > 0.95 and same.mean() == 0.5
    assert abs(other.mean() - 0.5) < 1e-6


def test_a_source_is_in_one_half():
    sources = list("aaabbbccddef")
    half = tell.halves(sources)
    assert all(len({bool(h) for h, s in zip(half, sources) if s == source}) == 1 for source in sources)
    assert abs(int(half.sum()) - int((~half).sum())) <= 1
    swapped = tell.others(sources, half)
    assert sorted(swapped.tolist()) == list(range(len(sources)))
    assert all(half[i] == half[j] and sources[i] != sources[j] for i, j in enumerate(swapped.tolist()))


def clip_of(x, meta=None):
    p, q = features.from_features(x.double().numpy())
    return store.Clip(p.astype(np.float32), q.astype(np.float32), np.zeros((len(p), 3), np.float32), meta=meta or {})


def test_a_body_that_holds_a_pose_rests_and_one_that_waves_does_not():
    held = make_tiny.sway(240)[:1].repeat(240, 1)
    waving = held.clone()
    hand = 3 + 36 * rig.INDEX["leftHand"]
    waving[:, hand:hand + 36].view(240, 12, 3)[..., 1] += 0.3 * torch.sin(torch.arange(240) / 5)[:, None]
    both = [clip_of(held), clip_of(waving)]
    rest = tell.resting([c.positions for c in both], [rig.quat_to_mat(c.rotations) for c in both])
    assert rest[0].all() and not rest[1].any()


def kept(folder, spoil):
    """Rows as `visavis eval --keep` writes them: five clips, one with a mirror image; the row `made` is `spoil` of the corpus'."""
    for i, name in enumerate(("a", "b", "b_mirror", "c", "d", "e")):
        x = make_tiny.sway(240 + 11 * i)[11 * i:]
        for row, motion in (("corpus", x), ("made", spoil(x, i))):
            (folder / row).mkdir(exist_ok=True)
            meta = {"clip": f"{name}.safetensors", "first_frame": "60"}
            store.rewrite(folder / row / f"{i:03}.safetensors", clip_of(motion, meta))


def test_what_was_kept_is_told(tmp_path, monkeypatch, capsys):
    noise = torch.Generator().manual_seed(0)
    kept(tmp_path, lambda x, i: x + 0.02 * torch.randn(x.shape, generator=noise))
    monkeypatch.setattr(sys, "argv", ["tell", "--motion", str(tmp_path), "--steps", "60", "--nets", "1"])
    tell.main()
    said = capsys.readouterr().out
    assert "6 pieces of 5 clips, 12 windows" in said, said
    rows = {c[1].strip(): float(c[2].split()[0]) for line in said.splitlines()[4:] if len(c := line.split("|")) > 3}
    assert set(rows) == {"made", "other"} and rows["made"] > 0.9 and rows["other"] == 0.5, said


def test_the_root_is_the_hips_in_every_row(tmp_path):
    """A root that is off the hips, as decoded, leaves no trace in what the net sees."""
    def shifted(x, i):
        x = x.clone()
        x[:, 3:].view(len(x), -1, 3)[..., 0] += 0.001
        return x
    kept(tmp_path, shifted)
    rows = {row: tell.seen_of(tell.read(tmp_path, row).values()) for row in ("corpus", "made")}
    assert torch.allclose(rows["corpus"], rows["made"], atol=2e-4)


def test_rows_of_other_windows_are_refused(tmp_path):
    kept(tmp_path, lambda x, i: x if i != 3 else x[:200])
    corpus, made = (tell.read(tmp_path, row) for row in ("corpus", "made"))
    with pytest.raises(SystemExit, match="made/003.safetensors"):
        tell.like(corpus, made, "made")
    made["003.safetensors"] = corpus["003.safetensors"]
    assert len(tell.like(corpus, made, "made")) == 6
    made["004.safetensors"].meta["first_frame"] = "520"
    with pytest.raises(SystemExit, match="made/004.safetensors"):
        tell.like(corpus, made, "made")
    with pytest.raises(SystemExit, match="eval --keep"):
        tell.read(tmp_path, "nobody")


def test_the_sampler_ends_at_the_last_prediction():
    seen = []

    def evaluate(z, tau, slot):
        seen.append(torch.full_like(z, tau))
        return seen[-1]

    z = Sampler([0, 0.5, 1]).run(torch.zeros(2), evaluate)
    assert torch.equal(z, seen[-1]) and [float(x[0]) for x in seen] == [0, 0.25, 0.5, 0.75]


def test_blocks_at_rest_weigh_more():
    history = torch.zeros(1, 3, 4)
    wish = history.clone()
    wish[:, 2] = 1.0
    w = student.rest_weight(wish, history, 4.0)
    assert w.mean().item() == 1 or abs(w.mean().item() - 1) < 1e-6
    assert abs((w[0, 0] / w[0, 1]).item() - 5 / (1 + 4 / 101)) < 1e-4
    assert torch.equal(student.rest_weight(wish, history, 0.0), torch.ones(1, 2))
