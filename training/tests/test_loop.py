"""Training that stops and goes on equals training that did not, for every trainer, on a corpus of seconds."""
import json
import os
import signal
import types

import numpy as np
import pytest
import torch
from scipy.io import wavfile

from visavis_train import export, make_tiny
from visavis_train.corpus import store
from visavis_train.motion import features, rig
from visavis_train.train import audio, cache, common, decoder, flow, loop, sizes, student, vae
from visavis_train.train.team import Team

TINY = {"audio": dict(layers=make_tiny.AUDIO, features=8), "vae": {**make_tiny.VAE, "layers": 1}, "flow": {**make_tiny.FLOW, "layers": 1}}


@pytest.fixture(autouse=True)
def quiet():
    """Trainers set handlers and threads of the process: put back."""
    kept = {s: signal.getsignal(s) for s in (signal.SIGTERM, signal.SIGINT)}
    torch.set_num_threads(1)
    yield
    for s, handler in kept.items():
        signal.signal(s, handler)


def call(module, *arguments, stop=None):
    """Runs a trainer in this process; `stop`: the step after which it is told to."""
    before = loop.Loop.report

    def report(self, *a, **kw):
        before(self, *a, **kw)
        if self.step == stop:
            os.kill(os.getpid(), signal.SIGTERM)

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sizes.SIZES, "tiny", TINY)
        patch.setattr("sys.argv", ["train", *map(str, arguments)])
        patch.setattr(loop.Loop, "report", report)
        patch.setattr(loop.curves, "draw", lambda log, out: open(out, "w").close())  # drawing takes longer than the training
        if stop is None:
            return module.main()
        with pytest.raises(SystemExit) as end:
            module.main()
        assert end.value.code == 128 + signal.SIGTERM


def same(a, b):
    """Whether two checkpoints hold the same, times apart."""
    if torch.is_tensor(a):
        return torch.equal(a, b)
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a if k != "elapsed")
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    return a == b


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A corpus of a few clips, its networks trained for a step or two."""
    root = tmp_path_factory.mktemp("work")
    random = np.random.default_rng(0)
    for split, count in (("train", 3), ("val", 1)):
        os.makedirs(root / "corpus" / split)
        for i in range(count):
            x = make_tiny.sway(320).numpy()
            x[1:, 1] = 0.01 * (i + 1)
            p, q = features.from_features(x)
            voice = lambda: 0.1 * random.standard_normal(320 * rig.SAMPLES_PER_FRAME)
            store.save(str(root / "corpus" / split / f"talk_{i}.safetensors"), p, rig.quat_to_mat(q), np.tile([0, 1.6, 2.0], (320, 1)), voice(),
                       voice() if i else None, {"kind": "talk", "split": split, "sources": []})
    os.makedirs(root / "speech")
    wavfile.write(str(root / "speech" / "a.wav"), 24000, (0.1 * random.standard_normal(60000)).astype(np.float32))
    few = ("--size", "tiny", "--steps", 2, "--batch", 2)
    call(audio, "--speech", root / "speech", "--out", root / "audio.pt", *few)
    call(vae, "--corpus", root / "corpus", "--out", root / "vae.pt", "--blocks", 8, *few)
    call(cache, "--corpus", root / "corpus", "--vae", root / "vae.pt", "--audio", root / "audio.pt", "--out", root / "cache")
    call(flow, "--cache", root / "cache", "--vae", root / "vae.pt", "--out", root / "flow.pt", *few)
    call(student, "--cache", root / "cache", "--vae", root / "vae.pt", "--flow", root / "flow.pt", "--out", root / "student.pt", "--steps", 2, "--batch", 2, "--teach", 2)
    return root


TRAINERS = {
    "audio": (audio, lambda r: ["--speech", r / "speech", "--size", "tiny"]),
    "vae": (vae, lambda r: ["--corpus", r / "corpus", "--size", "tiny", "--blocks", 8]),
    "flow": (flow, lambda r: ["--cache", r / "cache", "--vae", r / "vae.pt", "--size", "tiny", "--blocks", 24]),
    "flow-audio": (flow, lambda r: ["--cache", r / "cache", "--vae", r / "vae.pt", "--init", r / "flow.pt", "--end-to-end", r / "audio.pt", "--corpus",
                                    r / "corpus", "--live", 1, "--blocks", 24]),
    "student": (student, lambda r: ["--cache", r / "cache", "--vae", r / "vae.pt", "--flow", r / "flow.pt", "--teach", 2, "--reuse", 2, "--own", 100,
                                    "--blocks", 20, "--memory", 3]),
    "student-matching": (student, lambda r: ["--cache", r / "cache", "--vae", r / "vae.pt", "--flow", r / "flow.pt", "--teach", 2, "--reuse", 2,
                                             "--blocks", 20, "--memory", 3, "--matching", 0.5, "--adversarial", 0.1]),
    "decoder": (decoder, lambda r: ["--corpus", r / "corpus", "--cache", r / "cache", "--vae", r / "vae.pt", "--flow", r / "flow.pt", "--student",
                                    r / "student.pt", "--blocks", 8]),
    "decoder-texture": (decoder, lambda r: ["--corpus", r / "corpus", r / "corpus", "--vae", r / "vae.pt", "--noise", 0, "--texture", 0.1, "--adversarial", 0.1,
                                            "--blocks", 8]),
}


@pytest.mark.parametrize("name", TRAINERS)
def test_stopped_and_resumed_equals_uninterrupted(place, tmp_path, name):
    module, given = TRAINERS[name]
    line = [*given(place), "--steps", 5, "--batch", 2, "--seed", 7]
    call(module, *line, "--out", tmp_path / "whole.pt")
    call(module, *line, "--out", tmp_path / "parts.pt", stop=2)
    assert common.load(tmp_path / "parts.pt")["step"] == 3  # the step that was under way when it was told is finished
    if "--init" in line:
        at = line.index("--init")
        line = line[:at] + line[at + 2:]
    call(module, *line, "--out", tmp_path / "parts.pt", "--resume")
    whole, parts = common.load(tmp_path / "whole.pt"), common.load(tmp_path / "parts.pt")
    assert whole["step"] == 5 and same(whole, parts)
    call(module, *given(place), "--steps", 5, "--batch", 2, "--seed", 8, "--out", tmp_path / "other.pt")
    assert not same(whole["ema"], common.load(tmp_path / "other.pt")["ema"])
    with open(tmp_path / "whole.pt.json") as f:
        config = json.load(f)
    assert config["seed"] == 7 and config["steps"] == 5 and config["out"].endswith("whole.pt")


def test_checkpoints_make_a_bundle(place, tmp_path):
    out = tmp_path / "tiny.safetensors"
    at = lambda name: str(place / name)
    call(export, "--corpus", at("corpus"), "--audio", at("audio.pt"), "--vae", at("vae.pt"), "--flow", at("flow.pt"), "--student", at("student.pt"),
         "--out", out, "--name", "tiny")
    made = export.bundle.read(str(out))
    assert made.student is not None and made.config["flow"]["width"] == make_tiny.FLOW["width"]


def test_a_cache_can_keep_latents_or_features(place, tmp_path):
    call(cache, "--corpus", place / "corpus", "--latents-of", place / "cache", "--audio", place / "audio.pt", "--out", tmp_path / "again")
    call(cache, "--corpus", place / "corpus", "--features-of", place / "cache", "--vae", place / "vae.pt", "--out", tmp_path / "other")
    first = common.load(place / "cache" / "train.pt")
    assert same(first, common.load(tmp_path / "again" / "train.pt")) and same(first, common.load(tmp_path / "other" / "train.pt"))


def simple(tmp_path, steps, **kw):
    args = types.SimpleNamespace(**({"steps": steps, "minutes": None, "lr": 0.05, "out": str(tmp_path / "net.pt"), "seed": 0, "resume": False,
                                     "keep_minutes": 100.0} | kw))
    torch.manual_seed(0)
    return loop.Loop(Team(1), torch.nn.Linear(3, 1), args, warmup=5, average=0.9, size=3)


def test_a_loop_learns_and_logs(tmp_path):
    x = torch.randn(64, 3)
    wish = x @ torch.tensor([[1.0], [-2.0], [0.5]])
    error = lambda n: (n(x) - wish).square().mean()
    training = simple(tmp_path, 40)
    before = error(training.net).item()
    for _ in training:
        loss = error(training.net)
        training.update(loss, loss=loss)
        training.report(10, lambda n: {"val": error(n).item()}, 20)
    training.finish()
    rows = [json.loads(line) for line in open(str(tmp_path / "net.pt.jsonl"))][:-1]
    assert os.path.getsize(tmp_path / "net.pt.png") > 1000
    assert [r["step"] for r in rows] == [10, 20, 30, 40]
    assert ["val" in r for r in rows] == [False, True, False, True]
    assert rows[0]["loss"] > rows[-1]["loss"] and rows[-1]["val"] < 0.5 * before


def test_a_log_forgets_what_came_after_the_checkpoint(tmp_path):
    path = str(tmp_path / "log.jsonl")
    log = common.Log(path)
    for step in (10, 20, 30):
        log.write(step=step)
    common.Log(path, 20).write(step=25)
    assert [json.loads(line)["step"] for line in open(path)] == [10, 20, 25]


def test_minutes_become_steps(tmp_path):
    training = simple(tmp_path, 7, minutes=0.003)
    for _ in training:
        training.update(training.net(torch.randn(4, 3)).square().mean())
    assert training.step == training.steps >= loop.PROBE[1]
