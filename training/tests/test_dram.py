"""The featherweight tier: poses, causality, streaming, the step's definition, bundles, training, the corpus' partner."""
import json
import os
import signal

import numpy as np
import pytest
import torch

from visavis_train import bundle as bundles
from visavis_train.corpus import partner, store
from visavis_train.dram import agents, alike, bundle, data, goldens, live, make_tiny, measure, nets, pose, roll, train
from visavis_train.make_tiny import sway
from visavis_train.motion import features, rig

KINDS = ("tcn", "lstm")


def swaying(frames=200):
    p, q = features.from_features(sway(frames).numpy())
    return p, rig.quat_to_mat(q)


def small(kind, variant="dram", size=136):
    torch.manual_seed(0)
    sizes = make_tiny.SIZES[kind]
    return nets.Dram(size, 6, kind, sizes, variant).eval()


def given(batch, frames, size=136):
    g = torch.Generator().manual_seed(3)
    r = lambda *s: torch.randn(*s, generator=g)
    return r(batch, frames, size), r(batch, frames, size), nets.Heard(r(batch, frames, 7), r(batch, frames, nets.USER), r(batch, frames, 7))


def test_poses_go_there_and_back():
    p, r = swaying()
    y, roots = pose.from_world(p, r)
    places, turns = pose.kinematics(y[:, pose.LEAD:].unflatten(-1, (-1, 6)), y[:, 3])
    back = np.einsum("tab,tjb->tja", rig.axis_mat("y", roots[:, 2].numpy()), places.double().numpy())
    back += np.stack([roots[:, 0], np.zeros(len(p)), roots[:, 1]], -1)[:, None]
    assert np.abs(back - p).max() < 1e-5
    walked = roots[:1]
    for row in y[1:]:
        walked = torch.cat([walked, roll.advance(walked[-1:], row[None])])
    assert (walked - roots).abs().max() < 1e-4


def test_orthonormal_columns_are_rotations():
    m = pose.matrices(pose.orthonormal(torch.randn(50, 6)))
    assert (m.transpose(-1, -2) @ m - torch.eye(3)).abs().max() < 1e-5
    assert torch.allclose(torch.linalg.det(m), torch.ones(50), atol=1e-5)


def test_upper_body_is_part_of_the_whole():
    y = torch.randn(4, 136)
    layout = train.LAYOUTS["upper"]
    assert layout.size == 72 and torch.equal(layout.take(y)[:, 6 * 5:6 * 6], y[:, 4 + 6 * 5:4 + 6 * 6])
    delta = torch.rand(4, 136)
    each = pose.Layout().per_joint(delta)
    assert torch.allclose(each[:, 0], delta[:, :10].mean(-1)) and torch.allclose(each[:, 5], delta[:, 34:40].mean(-1))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("variant", nets.VARIANTS)
def test_frames_one_by_one_are_the_sequence_and_nothing_looks_ahead(kind, variant):
    net = small(kind, variant)
    p, before, heard = given(2, 20)
    whole, _, _ = net(p, before, heard, net.state(2))
    state, parts = net.state(2), []
    for t in range(20):
        out, _, state = net(p[:, t:t + 1], before[:, t:t + 1], heard.cut(t, t + 1), state)
        parts.append(out)
    assert (torch.cat(parts, 1) - whole).abs().max() < 1e-5
    heard.agent[:, 12:] += 1
    heard.voice[:, 12:] += 1
    later = net(torch.cat([p[:, :12], -p[:, 12:]], 1), before, heard, net.state(2))[0]
    assert torch.equal(later[:, :12], whole[:, :12]) and not torch.allclose(later[:, 12:], whole[:, 12:])


@pytest.mark.parametrize("kind", KINDS)
def test_the_sum_is_the_papers(kind):
    net = small(kind)
    net.step.fill_(0.05)
    p, before, heard = given(1, 6)
    caught = []
    hooks = [m.register_forward_hook(lambda _m, _i, out: caught.append(out[0])) for m in (net.monadic, net.dyadic)]
    y, delta, _ = net(p, before, heard, net.state(1))
    for h in hooks:
        h.remove()
    zm, zd = (p + net.step * c for c in caught)
    assert torch.allclose(delta, torch.tanh((zd - zm).abs() / net.step), atol=1e-4)
    assert torch.allclose(y, (1 - delta) * zm + delta * zd, atol=1e-5)
    assert delta.min() >= 0 and delta.max() <= 1


def test_tcn_forgets_what_is_out_of_reach():
    net = nets.Tcn(5, 4, 8, (1, 2, 4)).eval()
    x = torch.randn(1, 30, 5)
    y, _ = net(x, net.state(1))
    x2 = x.clone()
    x2[:, 29 - net.reach] += 1
    assert torch.equal(net(x2, net.state(1))[0][:, 29], y[:, 29])
    x2[:, 30 - net.reach] += 1
    assert not torch.equal(net(x2, net.state(1))[0][:, 29], y[:, 29])


def test_user_row_is_seen_from_the_root():
    root = torch.tensor([[1.0, 2.0, np.pi / 2]], dtype=torch.float64)     # faces +X
    row = data.frame_rows(root, torch.tensor([[3.0, 1.6, 2.0]]), torch.tensor([[-1.0, 0.0, 0.0]]), torch.tensor([0.5]), torch.ones(1, 3))[0]
    assert torch.allclose(row, torch.tensor([0, 1, 0, 0, 2 / 4.01 ** 0.5, 0, 0, -1, 1, 1, 0.5, 1]), atol=1e-5)
    absent = data.frame_rows(root, torch.tensor([[3.0, 1.6, 2.0]]), torch.ones(1, 3), torch.tensor([0.5]), torch.zeros(1, 3))
    assert (absent == 0).all()


@pytest.mark.parametrize("kind", KINDS)
def test_bundle_keeps_the_network(kind, tmp_path):
    path = str(tmp_path / "b.safetensors")
    tensors, config = make_tiny.build(kind)
    bundles.write(path, tensors, config)
    b = bundle.read(path)
    again = bundle.tensors_of(b.net)
    assert all(torch.equal(tensors[k], again[k]) for k in again)
    g = goldens.compute(b, 3)
    assert g["poses"].shape == (12, 136) and not torch.allclose(g["poses"], g["absent.poses"])
    assert not torch.equal(g["poses"], g["position.poses"])
    assert (g["user_rows"][:4, :10] == 0).all() and (g["user_rows"][4:, 8] == 1).all()


def fake_arrays(folder, frames=420):
    p, r = swaying(frames)
    y, roots = pose.from_world(p, r)
    g = np.random.default_rng(0)
    head = np.tile([0.2, 1.6, 1.5], (frames, 1))
    zero = lambda *s: np.zeros((frames, *s))
    made = {"y": y.numpy(), "roots": roots.numpy(), "head": head, "forward": np.tile([0, 0, -1.0], (frames, 1)), "turned": zero() + 1, "gaze": zero(),
            "agent": g.standard_normal((frames, 6)), "voice": g.standard_normal((frames, 6)), "has": zero(2) + 1, "speaks": zero(), "hears": zero(), "nods": zero()}
    made["hears"][100:160] = made["speaks"][80:120] = made["nods"][200:230] = True
    np.save(folder / "hush.npy", np.full(6, 0.25, np.float32))
    for split in ("train", "val"):
        (folder / split).mkdir()
        for name, v in made.items():
            np.save(folder / split / f"{name}.npy", v.astype(data.ARRAYS[name]))
        np.save(folder / split / "starts.npy", np.array([0, frames]))
        (folder / split / "names.json").write_text(json.dumps(["talk_0"]))


@pytest.mark.parametrize("kind,layout", [("tcn", "whole"), ("lstm", "upper")])
def test_training_runs_and_improves(kind, layout, tmp_path, monkeypatch):
    fake_arrays(tmp_path)
    for sizes in (train.SIZES, train.SMALL):
        monkeypatch.setitem(sizes, kind, make_tiny.SIZES[kind])
    out = tmp_path / "n.pt"
    monkeypatch.setattr("sys.argv", ["train", "--data", str(tmp_path), "--out", str(out), "--backbone", kind, "--layout", layout, "--steps", "30",
                                     "--batch", "4", "--own", "4", "--device", "cpu"])
    train.main()
    net, used, state = train.load(out)
    assert used == train.LAYOUTS[layout] and state["step"] == 30
    fresh, _ = train.build(type("A", (), {"backbone": kind, "layout": layout, "variant": "dram"}), 6, data.Split(str(tmp_path), "train"), used)
    held = data.Split(str(tmp_path), "val")
    w = held.at([0], [1], 400)
    with torch.no_grad():
        error = lambda n: ((roll.forced(n, w, used, 5, 300)[0] - roll.standardise(n, used.take(w.y[:, 5:300]))) / n.step).square().mean()
        assert error(net) < error(fresh)
    e, clips = measure.position_errors(net, used, held, 2, 96, 20)
    assert e.shape == (2, 20, 12) and torch.isfinite(e).all() and measure.group_errors(e).shape == (2, 20, 7)
    found = measure.deltas(net, used, held, 1, 300, 64)
    assert set(found) >= {"speaks", "nods", "interrupts", "silent and still"}
    if used.root:
        y, _, roots = roll.free(net, w, used, 96, 396)
        assert all(np.isfinite(v) for k, v in measure.liveliness(y, roots, w, 96).items() if k != "wrist talking")


@pytest.mark.parametrize("kind", KINDS)
def test_agents_live_on_in_their_own_motion(kind, tmp_path):
    fake_arrays(tmp_path)
    net, split = small(kind), data.Split(str(tmp_path), "train")
    for name, value in zip(("mean", "std", "step"), split.statistics(pose.Layout())):
        getattr(net, name).copy_(value)
    torch.manual_seed(5)
    pool = agents.Agents(net, split, 6, 8, short=10 ** 9)
    pool.at[:] = split.starts[0] + 1 + agents.REACH
    pool._begin(net, torch.arange(6))
    pool.at[:] = split.starts[0] + 1 + agents.REACH + 5
    first, roots, w = pool.stretch(net)
    assert first.shape == (6, agents.PAST + 8, 136) and first[:, agents.PAST:].requires_grad and torch.equal(w.y[0, 0], split.y[int(pool.at[0]) - 8 - agents.PAST])
    second, after, _ = pool.stretch(net)
    assert torch.equal(second[:, agents.PAST - 8:agents.PAST], first[:, agents.PAST:].detach())
    walked = roots[:, -1].detach()
    for t in range(agents.PAST, agents.PAST + 8):
        walked = roll.advance(walked, second[:, t].detach())
    assert (walked - after[:, -1].detach()).abs().max() < 1e-5
    pool.hushed[1] = pool.fixed[2] = True
    given = pool._window(torch.arange(6), pool.at, 4)
    assert (given.agent[1] == 0.25).all() and (given.voice[1] == 0.25).all() and not (given.agent[2] == 0.25).any()
    assert (given.head[2] == pool.seat[2]).all() and torch.equal(given.head[1], split.head[int(pool.at[1]):int(pool.at[1]) + 4])
    kept = agents.Agents(net, split, 6, 8, short=10 ** 9)
    kept.load_state_dict(pool.state_dict())
    torch.manual_seed(1)
    a = pool.stretch(net)[0]
    torch.manual_seed(1)
    assert torch.equal(a, kept.stretch(net)[0])
    pool.at[:] = split.starts[1] - 3
    third, moved, w = pool.stretch(net)   # at the clip's end: elsewhere, beside the recorded agent
    assert (moved[:, agents.PAST - 1, :2] - w.roots[:, agents.PAST - 1, :2]).norm(dim=-1).max() < 0.6 and torch.isfinite(third).all()


def test_losses_tell_motion_that_differs(tmp_path):
    fake_arrays(tmp_path)
    split = data.Split(str(tmp_path), "train")
    w = split.at([0] * 12, [40 + 20 * i for i in range(12)], agents.PAST + 32)
    real = alike.Body(w.y, w.roots, w.head)
    truth = np.stack([rig.gaze_score(p, r, u) for p, r, u in zip(*measure.body(w.y, w.roots), w.head.numpy())])
    assert (real.score - torch.from_numpy(truth)).abs().max() < 1e-4
    kinds = alike.doing(w)
    assert kinds.shape == (12, 4, 4) and (kinds.sum(-1) == 1).all()
    still = alike.Body(w.y[:, :1].expand_as(w.y), w.roots[:, :1].expand_as(w.roots))
    std = torch.full((rig.J, 3), 0.1)
    assert alike.alike(real, real, kinds) == 0 and alike.poses(real, real, std) == 0
    assert alike.alike(still, real, kinds) > 0.1 and alike.poses(still, real, std) > 0
    slid = w.roots.clone()
    slid[..., 0] += torch.arange(agents.PAST + 32) * 0.02
    assert alike.feet(alike.Body(still.y, slid)) > alike.feet(still) + 0.3
    score, told = torch.full((2, 8), 0.5), torch.ones(2, 2)
    loss = lambda wanted: alike.own_scores(score, torch.full((2,), 0.5), torch.full((2,), wanted), told, torch.ones(2, dtype=torch.bool), score)[0]
    assert loss(0.5) == 0 < loss(0.2) < loss(-0.2)


@pytest.mark.parametrize("kind", KINDS)
def test_training_in_own_motion_goes_on_where_it_was(kind, tmp_path, monkeypatch):
    fake_arrays(tmp_path)
    monkeypatch.setitem(train.SIZES, kind, make_tiny.SIZES[kind])
    monkeypatch.setattr(live, "judged", lambda net, data: {})
    base = ["--data", str(tmp_path), "--device", "cpu", "--batch", "4"]
    call = lambda module, *more: (monkeypatch.setattr("sys.argv", [module.__name__, *base, *more]), module.main())
    call(train, "--out", str(tmp_path / "n.pt"), "--backbone", kind, "--steps", "3", "--own", "2")
    own = ["--init", str(tmp_path / "n.pt"), "--agents", "8", "--frames", "8", "--steps", "6"]
    call(live, "--out", str(tmp_path / "a.pt"), *own)
    stopping = live.Live.__call__
    monkeypatch.setattr(live.Live, "__call__", lambda self, step, batch: (stopping(self, step, batch), os.kill(os.getpid(), signal.SIGTERM) if step == 2 else None)[0])
    with pytest.raises(SystemExit):
        call(live, "--out", str(tmp_path / "b.pt"), *own)
    monkeypatch.setattr(live.Live, "__call__", stopping)
    call(live, "--out", str(tmp_path / "b.pt"), *own, "--resume")
    a, b, start = (train.load(str(tmp_path / f"{n}.pt"))[0].state_dict() for n in "abn")
    assert all(torch.equal(a[k], b[k]) for k in a) and any(not torch.equal(a[k], start[k]) for k in a)


def test_noise_is_slow_and_forecasts_are_free_of_its_size():
    n = train.noise(torch.zeros(400, 60, 3), torch.ones(3), 0.5)
    assert (n == 0).all(-1).all(-1).float().mean() == pytest.approx(1 / 3, abs=0.1)
    moving = n[(n != 0).any(-1).any(-1)]
    assert (moving.diff(dim=1).square().mean() / moving.square().mean()) < 0.2


def test_user_nods_where_the_agent_ends_and_the_agent_mirrors():
    p, r = swaying(1800)
    user = np.tile([0.0, 1.6, 1.5], (1800, 1))
    agent_phrases = [(2.0 + 6 * i, 5.0 + 6 * i) for i in range(9)]
    changed, looks = 0, []
    for seed in range(4):
        seen, q, turned, nods = partner.perform(np.random.default_rng(seed), p, r, user, agent_phrases, [])
        toward = rig.unit(p[:, 5] - user)
        looks.append(np.median((seen[..., 2] * toward).sum(-1)))
        assert np.abs(np.linalg.norm(q[:, 5] - q[:, 4], axis=-1) - np.linalg.norm(rig.OFFSETS[5])).max() < 1e-6
        moved = np.abs(turned - r).max((1, 2, 3)) > 1e-3
        assert not moved.any() or nods
        assert np.abs(turned[:, 6:] - r[:, 6:]).max() < 1e-12  # by way of the local rotations
        changed += moved.any()
    assert changed
    # Some users look at the agent, others past it: a level of their own.
    assert max(looks) > 0.95 and np.mean(looks) > 0.4 and min(looks) > 0, looks


def test_clips_may_have_the_users_rotation(tmp_path):
    p, r = swaying(60)
    turn = rig.axis_mat("y", np.full(60, 2.0))
    store.save(tmp_path / "a.safetensors", p, r, np.zeros((60, 3)), None, None, {"kind": "talk"}, turn)
    store.save(tmp_path / "b.safetensors", p, r, np.zeros((60, 3)), None, None, {"kind": "talk"})
    a, b = store.load(tmp_path / "a.safetensors"), store.load(tmp_path / "b.safetensors")
    assert b.user_head_rotation is None and a.user_head_rotation.shape == (60, 4)
    b = partner.extend(b, "b")
    store.rewrite(tmp_path / "c.safetensors", b)
    c = store.load(tmp_path / "c.safetensors")
    assert np.array_equal(c.user_head_rotation, b.user_head_rotation) and json.loads(c.meta["user_nods"]) is not None
