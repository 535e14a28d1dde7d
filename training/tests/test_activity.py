"""The activity of a body at rest: where it is told, what it is told, and a way in for it with all else held."""
import json

import numpy as np
import torch
from safetensors import safe_open
from test_train import made_windows, small_flow, walker

from visavis_train import bundle, make_tiny
from visavis_train.motion import rig
from visavis_train.nets.flow import ACTIVITY, absent
from visavis_train.nets.stream import Reference, Stream, branches
from visavis_train.train import activity

STATE = {"latent": 8, "audio": 6, "size": dict(layers=2, width=32, heads=4, mlp=2, tau_width=16, window_blocks=5, embed_latent=16, embed_user=8,
                                               embed_voice=12, embed_gaze=4)}


def told(cond, level, flag=1.0):
    shape = cond.flags.shape[:2]
    cond.activity, cond.resting = torch.tensor(level).expand(*shape, ACTIVITY), torch.full((*shape, 1), flag)
    return cond


def test_a_body_rests_a_second_after_it_spoke_before_a_user_who_stands():
    frames = 160
    voice, user = np.zeros(800 * frames, np.int16), np.zeros((frames, 3))
    assert activity.at_rest(None, user, frames).all() and activity.at_rest(voice, user, frames).all()
    voice[800 * 40 + 7] = -2000
    rests = activity.at_rest(voice, user, frames)
    # Block 10 knows its own voice; frame 72, the first that is 32 behind frame 40, is the last but three of block 18.
    assert rests[:40].all() and not rests[40:72].any() and rests[72:].all()
    user[100:] = [0.4, 0, 0]
    rests = activity.at_rest(None, user, frames)
    assert rests[:104].all() and not rests[104:132].any() and rests[136:].all(), np.flatnonzero(~rests)


def test_activity_is_a_mean_over_the_frames_at_rest():
    p, q = walker(240)
    rotations = rig.quat_to_mat(q)
    resting = np.arange(240) < 120
    total = torch.from_numpy(activity.sums(p, rotations, resting)).float()
    stir, hand, head = activity.levels(total[-1] - total[0])
    assert torch.equal(total[120], total[-1]), "frames that are not at rest do not count"
    t = activity.measures.tracks(p, rotations)
    assert abs(stir - (2 * (t["hand_v"][:120] >= activity.measures.STILL).any(1).mean() - 1)) < 1e-6
    assert abs(hand - np.log2(t["hand_v"][:120].mean() / 0.04) / 3) < 1e-4 and abs(head - np.log2(t["head_v"][:120].mean() / 0.015) / 2) < 1e-4


def test_windows_tell_each_token_of_its_stretch(tmp_path, monkeypatch):
    plain = made_windows(tmp_path, frames=400)
    sums = torch.zeros(2 * 401, 4)
    for clip in range(2):
        stirs = (torch.arange(400) >= 240).float()
        rows = torch.stack([stirs, 0.04 + 0 * stirs, 0.015 + 0 * stirs, torch.ones(400)], 1)
        rows[300:] = 0   # no rest
        sums[401 * clip + 1: 401 * (clip + 1)] = rows.cumsum(0)
    monkeypatch.setattr(activity, "SHORT", 80)
    monkeypatch.setattr(activity, "LONG", 81)
    w = activity.Told(str(tmp_path / "train.pt"), sums, 16, keep=1.0, jitter=False)
    place = (plain.segments[[0, 0]], torch.tensor([20, 80]))
    z, cond = w.batch(2, place)
    assert cond.resting[0].all() and not cond.resting[1, :, 0].any(), "frames 300 on are no rest"
    assert torch.equal(cond.activity[0, :, 0], torch.full((16,), -1.0)), "no stretch of the first window reaches frame 240"
    assert cond.activity[0, :, 1:].abs().max() < 1e-3
    dropped = activity.Told(str(tmp_path / "train.pt"), sums, 16, keep=0.0).batch(4)[1]
    assert not dropped.resting.any()


def test_a_way_in_begins_as_nothing_and_learns_alone():
    torch.manual_seed(0)
    net = small_flow()
    new = activity.told(net, STATE)
    z, tau, cond = torch.randn(2, 6, 8), torch.full((2, 1), 0.4), absent(2, 6, 6)
    before = net(z, tau, cond)
    assert torch.equal(new(z, tau, told(cond, [0.3, -0.2, 0.1])), before)
    (new(z, tau, cond) - torch.randn(2, 6, 8)).square().mean().backward()
    learns = {n for n, p in new.named_parameters() if p.grad is not None and p.grad.abs().max() > 0}
    assert learns and all("embed_activity" in n for n in learns)


def test_streams_that_guide_early_equal_the_reference():
    torch.manual_seed(0)
    net = make_tiny.lively(activity.told(small_flow(), STATE)).eval()
    runs = []
    for until in (None, 0.3):
        torch.manual_seed(1)
        one, all_ = Stream(net, 1, 1.5, 2.0, gaze=True, guided_until=until), Reference(net, 1.5, 2.0, guided_until=until)
        first, eps = torch.randn(1, 1, 8), torch.randn(1, 7, 1, 8)
        cond = told(absent(1, 1, 6), [0.5, 0.1, -0.4])
        one.warm(first, eps[:, 0], cond)
        all_.push(first, eps[:, 0], branches(cond, True))
        with torch.no_grad():
            for k in range(1, 7):
                cond = told(absent(1, 1, 6), [0.2 * k, 0.1, -0.4], float(k != 3))
                cond.flags[..., 1:] = 1
                cond.agent, cond.gaze = torch.randn(1, 1, 24), torch.full((1, 1, 4), 0.5)
                z = one.step(eps[:, k], cond)
                new, _ = all_.sample(eps[:, k], branches(cond, True))
                all_.push(new, eps[:, k], branches(cond, True))
                assert torch.allclose(z, new, atol=1e-5)
        runs.append(z)
    assert not torch.allclose(*runs, atol=1e-2), "guidance of late evaluations matters"


def test_a_graft_leaves_other_tensors_alone(tmp_path):
    tensors, config = make_tiny.build()
    source, out = str(tmp_path / "a.safetensors"), str(tmp_path / "b.safetensors")
    bundle.write(source, tensors, config, half=True)
    flow = bundle.read(source).flow
    new = make_tiny.lively(activity.told(flow, {"latent": 8, "audio": 8, "size": make_tiny.FLOW}))
    table = torch.tensor([[-1.0, -0.5, 0.2], [0.5, 0.1, 0.3]])
    activity.graft(source, new.state_dict(), table, out)
    with safe_open(source, "pt") as a, safe_open(out, "pt") as b:
        assert all(torch.equal(a.get_tensor(k), b.get_tensor(k)) for k in a.keys())
        assert json.loads(b.metadata()["visavis"])["rest"]["levels"] == [[-1.0, -0.5, 0.2], [0.5, 0.1, 0.3]]
    read = bundle.read(out)
    for net in (read.flow, read.student):
        assert torch.allclose(net.embed_activity["2"].weight, new.embed_activity["2"].weight, atol=1e-3)
