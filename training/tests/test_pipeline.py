"""The one-command pipeline, features of a larger model as targets, corpora built by several processes."""
import types

import numpy as np
import pytest

from visavis_train.corpus import build
from visavis_train.train import all as pipeline
from visavis_train.train import audio


def arguments(**kw):
    given = dict(work="W", data="D", hours=1.0, scale=0.5, size="base", threads=1, workers=2, start=None)
    return types.SimpleNamespace(**(given | kw))


def test_stages_hand_on_what_they_make():
    stages = pipeline.stages(arguments())
    assert [s[0] for s in stages] == ["corpus", "audio", "vae", "cache", "flow", "flow-audio", "relisten", "student", "decoder", "curves", "export-f32", "export-f16"]
    made = {"W/corpus", "W/runs/curves"}
    for name, _, _, line in stages:
        made |= {line[i + 1] for i, word in enumerate(line) if word == "--out"}
        made |= {line[i + 1] + ".audio" for i, word in enumerate(line) if word == "--out" and "--end-to-end" in line}
        needed = {line[i + 1] for i, word in enumerate(line)
                  if word in ("--vae", "--audio", "--flow", "--student", "--cache", "--corpus", "--relisten", "--end-to-end", "--init")}
        assert needed <= made, f"{name} needs {needed - made}"
    minutes = {s[0]: s[3][s[3].index("--minutes") + 1] for s in stages if "--minutes" in s[3]}
    assert minutes["vae"] == str(pipeline.MINUTES["vae"] * 0.5)


def test_own_clips_need_no_recordings_but_a_bundle_to_start_from():
    stages = pipeline.stages(arguments(data=None, start="B"))
    assert [s[0] for s in stages][:3] == ["start", "vae", "cache"]
    assert "W/runs/start/audio.pt" in stages[2][3]
    with pytest.raises(SystemExit, match="--data"):
        pipeline.stages(arguments(data=None))


def test_a_checkpoint_that_is_there_is_resumed(tmp_path):
    there = tmp_path / "vae.pt"
    there.write_bytes(b"")
    line = pipeline.command(str(there), "train.vae", ["--out", str(there), "--init", "x.pt", "--minutes", "3"])
    assert "--resume" in line and "--init" not in line and "x.pt" not in line and line[-3:-1] == ["--minutes", "3"]
    assert "--resume" not in pipeline.command(str(tmp_path / "no.pt"), "train.vae", ["--out", "y"])


def test_teacher_features_follow_the_cut():
    rate = 50.0
    wave = np.linspace(0.1, 1, 10 * audio.RATE).astype(np.float32)       # its value tells the place
    seconds = np.arange(int(10 * rate)) / rate
    batches = audio.Batches([wave], 30, teacher=[seconds[:, None].astype(np.float32)], rate=rate)
    seen = 0
    for _ in range(30):
        cut, wish, known = batches.one()
        assert cut.shape == (30 * 800,) and wish.shape == (30, 1)
        if known:
            step = np.diff(wish[:, 0])
            assert step.min() >= 0 and 1 / 30 / 1.4 < step.mean() < 1.4 / 30  # speeds between 1 / 1.35 and 1.35
            seen += 1
    assert seen > 10
    _, wish, known = batches.batch(4)
    assert wish.shape == (4, 30, 1) and known.shape == (4,)


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
