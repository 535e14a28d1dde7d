"""The one-command pipeline, features of a larger model as targets, corpora built by several processes."""
import types

import numpy as np
import pytest
import torch

from visavis_train.corpus import build
from visavis_train.train import all as pipeline
from visavis_train.train import audio


def arguments(**kw):
    given = dict(work="W", data="D", hours=1.0, scale=0.5, size="base", seed=3, threads=1, workers=2, processes=None, start=None, keep_minutes=4.0, more=[])
    return types.SimpleNamespace(**(given | kw))


def test_stages_hand_on_what_they_make():
    stages = pipeline.stages(arguments())
    assert [s[0] for s in stages] == ["corpus", "arrays", "audio", "vae", "cache", "flow", "flow-audio", "relisten", "student", "decoder", "curves", "export-f32", "export-f16"]
    made = {"W/corpus", "W/runs/curves"}
    for name, _, _, line in stages:
        made |= {line[i + 1] for i, word in enumerate(line) if word == "--out"}
        needed = {line[i + 1] for i, word in enumerate(line)
                  if word in ("--vae", "--audio", "--flow", "--student", "--cache", "--corpus", "--latents-of", "--end-to-end", "--init")}
        assert needed <= made, f"{name} needs {needed - made}"
    steps = {s[0]: s[3][s[3].index("--steps") + 1] for s in stages if "--steps" in s[3]}
    assert tuple(steps) == pipeline.TRAINED
    assert steps["vae"] == str(pipeline.STEPS["base"]["vae"] // 2)


def test_stages_take_further_arguments():
    stages = {s[0]: s[3] for s in pipeline.stages(arguments(more=[pipeline.pair("flow:--lr 1e-3 --batch 8")]))}
    assert stages["flow"][-4:] == ["--lr", "1e-3", "--batch", "8"] and "--batch" not in stages["vae"]
    with pytest.raises(Exception, match="none of"):
        pipeline.pair("walk:--lr 1")


def test_own_clips_need_no_recordings_but_a_bundle_to_start_from():
    stages = pipeline.stages(arguments(data=None, start="B"))
    assert [s[0] for s in stages][:4] == ["start", "arrays", "vae", "cache"]
    assert "W/runs/start/audio.pt" in stages[3][3]
    with pytest.raises(SystemExit, match="--data"):
        pipeline.stages(arguments(data=None))


def test_a_checkpoint_that_is_there_is_resumed(tmp_path):
    there = tmp_path / "vae.pt"
    there.write_bytes(b"")
    line = pipeline.command(str(there), "train.vae", ["--out", str(there), "--init", "x.pt", "--steps", "3"])
    assert "--resume" in line and "--init" not in line and "x.pt" not in line and line[-3:-1] == ["--steps", "3"]
    assert "--resume" not in pipeline.command(str(tmp_path / "no.pt"), "train.vae", ["--out", "y"])


def test_cuts_and_teacher_features_are_of_one_place():
    rate, seconds = 50.0, 10
    wave = np.linspace(0.1, 1, seconds * audio.RATE).astype(np.float32)       # its value tells the place
    rows = (np.arange(int(seconds * rate)) / rate)[:, None].astype(np.float32)
    batches = audio.Batches([wave, wave], 30, teacher=[rows, None], rate=rate)
    torch.manual_seed(0)
    cut, which, at, speed = batches.cut(16)
    assert cut.shape == (16, 30 * 800) and set(which.tolist()) == {0, 1}
    begins = 0.1 + 0.9 * at / (len(wave) - 1)
    assert torch.allclose(cut[:, 0], begins.float(), atol=1e-4)
    assert torch.allclose(cut[:, -1], (begins + 0.9 * (30 * 800 - 1) * speed / (len(wave) - 1)).float(), atol=1e-4)
    torch.manual_seed(0)
    heard, wish, known = batches.batch(16)
    assert heard.shape == cut.shape and wish.shape == (16, 30, 1)
    for row in range(16):
        if which[row] == 0:
            ends = (at[row] + torch.arange(1, 31) * 800 * speed[row]) / audio.RATE
            assert torch.allclose(wish[row, :, 0], ends.float().clamp(max=rows.max()), atol=0.5 / rate + 1e-3)
        else:
            assert known[row] == 0
    assert 0 < known.sum() < (which == 0).sum() + 1


def test_a_cut_of_a_short_wave_ends_in_silence():
    batches = audio.Batches([np.ones(6000, np.float32)], 30)
    cut, _, at, speed = batches.cut(8)
    left = ((6000 - at) / speed).long()
    for row in range(8):
        assert (cut[row, :left[row] - 2] == 1).all() and (cut[row, left[row] + 2:] == 0).all()


def test_teacher_files_must_belong_to_the_speech(tmp_path):
    with pytest.raises(SystemExit, match="no .npy"):
        audio.load_teacher(str(tmp_path), "/speech", ["/speech/a/b.wav"])
    (tmp_path / "a").mkdir()
    np.save(tmp_path / "a" / "b.npy", np.arange(12.0).reshape(6, 2))
    rows = audio.load_teacher(str(tmp_path), "/speech", ["/speech/a/b.wav", "/speech/c.wav"])
    assert rows[1] is None and abs(rows[0].mean()) < 1e-5 and rows[0].shape == (6, 2)


def test_clip_lengths_fill_the_hours():
    frames = build.clip_lengths(0, 0, 0.5)
    assert sum(frames) >= 0.5 * 108000 and sum(frames[:-1]) < 0.5 * 108000
    assert all(1796 <= n <= 3600 and n % 4 == 0 for n in frames)
    assert frames == build.clip_lengths(0, 0, 0.5) != build.clip_lengths(0, 1, 0.5)
    assert build.split_hours(20.0) == {"train": 20.0, "val": 1.0, "test": 1.0}
