"""Ablations and rivals on a corpus of seconds: their networks see what they should, their motion stands on the rig, they stop and go on."""
import os

import numpy as np
import pytest
import torch
from safetensors import safe_open
from test_loop import TINY, call, quiet, same  # noqa: F401

from visavis_train import make_tiny
from visavis_train.corpus import store
from visavis_train.motion import features, rig
from visavis_train.nets.flow import Condition
from visavis_train.nets.stream import decoding
from visavis_train.nets.vae import Vae
from visavis_train.rivals import body, data, directions, motion, nets, offline, place, train
from visavis_train.train import audio, cache, common, forms, vae
from visavis_train.train.data import compact
from visavis_train.train.geometry import integrate

SIZE = {k: v for k, v in make_tiny.FLOW.items()}


@pytest.fixture(autouse=True)
def seeded():
    torch.manual_seed(0)


def frames(count=80):
    p, q = features.from_features(make_tiny.sway(count).numpy())
    return torch.from_numpy(compact(p, q)[0]), p, rig.quat_to_mat(q)


def conditions(b, t):
    return Condition(torch.randn(b, t, 8), torch.randn(b, t, 24), torch.randn(b, t, 24), torch.rand(b, t, 4), torch.ones(b, t, 4))


def changed(a, b):
    return ((a - b).abs().flatten(2).amax((0, 2)) > 1e-6).nonzero()[:, 0].tolist()


@pytest.mark.parametrize("name", forms.FORMS)
def test_every_form_says_where_the_joints_are(name):
    c, p, r = frames()
    form = forms.FORMS[name]
    x = form.of(c)
    assert forms.joints_of(x.shape[-1], form) == rig.J and x.shape[-1] == 3 + form.size * rig.J + form.tail
    assert torch.allclose(form.points(x), forms.positions(c), atol=2e-5)
    if name != "positions":
        assert np.allclose(rig.polar(form.axes(x).numpy().astype(np.float64)), forms.rotations(c).numpy(), atol=1e-4)
    moved = x + 0.01 * torch.randn_like(x)
    zero, one = torch.zeros(x.shape[-1]), torch.ones(x.shape[-1])
    w, jw = vae.channel_weights(x.shape[-1], form=form), vae.joint_weights(rig.J)
    of = lambda y: vae.losses(x[None, :64], y[None, :64], zero, one, torch.zeros(1, 1), torch.zeros(1, 1), w, jw, form)
    assert all(of(moved)[k] > 3 * of(x)[k] + 1e-5 for k in ("feature", "position", "velocity")) and set(of(x)) == set(of(moved))


@pytest.mark.parametrize("name, off", [("icosahedra", 1e-3), ("angles", 1e-3), ("positions", 2e-2)])
def test_bodies_stand_on_the_rig_where_they_were_decoded(name, off):
    c, p, r = frames()
    form, roots = forms.FORMS[name], torch.from_numpy(compact(p, rig.mat_to_quat(r))[1])
    made, turned = body.motion(form, form.of(c), roots)
    parents = np.array(rig.PARENTS[1:])
    assert np.allclose(np.linalg.norm(made[:, 1:] - made[:, parents], axis=-1), np.linalg.norm(rig.OFFSETS[1:], axis=-1), atol=1e-9)
    assert np.abs(made - p).max() < off
    if name != "positions":
        assert np.abs(turned - r).max() < 3e-3     # a straight arm turns by the root of what rounds it
    noisy = form.of(c) + 0.01 * torch.randn(c.shape[0], form.of(c).shape[1])
    made, turned = body.motion(form, noisy, roots)
    assert np.isfinite(made).all() and np.allclose(turned @ turned.swapaxes(-1, -2), np.eye(3), atol=1e-9)
    ends = [rig.INDEX[k] for k in ("leftHand", "rightHand", "leftFoot", "rightFoot")]
    if name == "icosahedra":        # a limb's end is met, whatever noise does to the joints between
        want = np.einsum("tab,tjb->tja", rig.axis_mat("y", roots[:, 2].numpy()), form.points(noisy.double()).numpy())[:, ends] + np.stack(
            [roots[:, 0], 0 * roots[:, 0], roots[:, 1]], -1)[:, None]
        assert np.linalg.norm(made[:, ends] - want, axis=-1).mean() < 0.01


def test_a_plain_vae_is_causal_and_streams_as_it_decodes():
    net = make_tiny.lively(Vae(75, 8, 2, 16, 2, 2, 3, interleaved=False))
    x = torch.randn(1, 24, 75)
    moved = x.clone()
    moved[:, 9] += 1
    assert changed(net.encoder(x)[0], net.encoder(moved)[0])[0] == 2
    z = net.encoder(x)[0]
    later = z.clone()
    later[:, 3] += 1
    whole = net.decoder(z)
    assert changed(whole, net.decoder(later))[0] == 12
    step = decoding(net.decoder)
    with torch.no_grad():
        assert torch.allclose(torch.cat([step(z[:, k:k + 1]) for k in range(6)], 1), whole, atol=1e-5)


def test_codes_go_there_and_back():
    net = make_tiny.lively(Vae(75, 8, 1, 16, 2, 2, 3, codes=32))
    x = torch.randn(3, 16, 75)
    mu = net.encoder(x)[0]
    net.quantiser.begin(mu)
    codes = net.quantiser.codes(mu)
    assert codes.shape == (3, 4, 4) and 0 <= codes.min() and codes.max() < 32 and len(codes.unique()) > 4
    with torch.no_grad():
        near = net.quantiser.vectors(codes)
        distance = (net.quantiser.normalised(mu)[:, :, 1, None] - net.quantiser.books[1]).square().sum(-1)
        assert torch.equal(distance.argmin(-1), codes[..., 1])
        assert torch.allclose(net.quantiser(mu), near, atol=1e-6) and torch.allclose(net(x)[0], net.decoder(near), atol=1e-6)
    before = net.quantiser.loss(mu.detach()).item()
    optim = torch.optim.SGD([net.quantiser.books], 2.0)
    for _ in range(20):
        optim.zero_grad()
        net.quantiser.loss(mu.detach()).backward()
        optim.step()
    assert net.quantiser.loss(mu).item() < 0.9 * before
    net(x)[0].square().mean().backward()
    assert net.encoder.mu.weight.grad.abs().max() > 0


def test_levels_of_codes_come_nearer_with_each():
    x = torch.randn(400, 6) * torch.tensor([3.0, 1, 1, 1, 1, 0.1])
    levels = offline.Levels(6, 3, 16).fit(x, torch.tensor([1.0, 1, 1, 1, 1, 2]))
    codes = levels.codes(x)
    errors = [(sum(levels.books[i][codes[..., i]] for i in range(n)) / levels.scale - x).square().mean().item() for n in (1, 2, 3)]
    assert errors[0] > errors[1] > errors[2] and errors[2] < 0.3 * x.square().mean().item()
    assert torch.allclose(levels.vectors(codes), sum(levels.books[i][codes[..., i]] for i in range(3)) / levels.scale)


def test_directions_give_back_what_lies_in_them():
    basis, code = torch.randn(5, 4 * 7), torch.randn(30, 6, 5)
    x = (code @ basis).unflatten(-1, (4, 7)).flatten(1, 2)
    net = directions.fit(x, torch.rand(7) + 0.5, 5)
    with torch.no_grad():
        assert torch.allclose(net(x)[0], x, atol=1e-3)
        assert torch.allclose(net.encoder(x)[0].flatten(0, 1).var(0), torch.ones(5), atol=0.05)


def test_offline_sees_what_is_to_come_and_codes_do_not():
    net = make_tiny.lively(nets.Offline(8, 6, keys=8, **SIZE))
    z, cond, t = torch.randn(1, 9, 8), conditions(1, 9), torch.tensor([400])
    keys = offline.keys(torch.randn(1, 1, 8), 9)
    base = net(z, t, cond, keys)
    cond.voice[:, 8] += 1
    assert changed(base, net(z, t, cond, keys)) == list(range(9))
    assert changed(base, net(z, t, cond, 0 * keys)) == list(range(9)) and keys[0, :, -1].tolist() == [0, 0, 0, 0, 1, 0, 0, 0, 0]
    speaker = make_tiny.lively(nets.Speaker(6, 16, 3, 12, **SIZE))
    codes, cond = torch.randint(16, (1, 6, 3)), conditions(1, 6)
    hidden = lambda codes, cond: speaker.net(torch.cat([speaker.start.expand(1, 1, -1), speaker.embedded(codes[:, :-1])], 1), torch.ones(1, 1), cond)
    base, other = hidden(codes, cond), codes.clone()
    other[:, 3] = (other[:, 3] + 1) % 16
    assert changed(base, hidden(other, cond)) == [4, 5]
    cond.user[:, 3] += 1
    assert changed(base, hidden(codes, cond)) == [3, 4, 5]


def test_telling_on_equals_telling_at_once():
    speaker = make_tiny.lively(nets.Speaker(6, 16, 3, 12, **SIZE))
    codes, cond = torch.randint(16, (2, 9, 3)), conditions(2, 9)
    telling = nets.Telling(speaker, torch.Generator().manual_seed(0), temperature=1e-4)
    for k in range(8):
        telling.step(cond.at(slice(k, k + 1)), codes[:, k:k + 1])
    last = telling.step(cond.at(slice(8, 9)))
    with torch.no_grad():
        hidden = speaker.net(torch.cat([speaker.start.expand(2, 1, -1), speaker.embedded(codes[:, :-1])], 1), torch.ones(2, 1), cond)[:, 8:]
        for g in range(3):
            assert torch.equal(speaker.logits(hidden, last[..., :g]).argmax(-1), last[..., g])


def test_a_route_follows_places_slowly_and_steps_finely():
    steps = torch.zeros(1, 120, 3)
    steps[:, 1:, 1], steps[:, 1:, 2] = 0.02 + 0.01 * torch.sin(torch.arange(119.0)), 0.05
    truth = integrate(steps.double())
    there = data.placed(truth)
    assert torch.allclose(data.route(steps, there), truth, atol=1e-5)
    shaken = data.route(steps, there + 0.02 * torch.randn_like(there))
    assert (shaken - truth).abs().max() < 0.05 and (shaken - truth).diff(dim=1)[:, 20:-20].abs().max() < 0.006
    lost = data.route(steps * torch.tensor([1.0, 1.0, 0.9]), there)     # the yaw of the steps falls behind by half a turn
    assert (lost - truth)[..., 2].abs().max() < 0.1 and (lost - truth)[..., :2].abs().max() < 0.1


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    """A corpus of four clips with kept windows, an audio encoder, a cache of its features."""
    root, random = tmp_path_factory.mktemp("rivals"), np.random.default_rng(0)
    for split, count in (("train", 2), ("val", 1), ("test", 1)):
        os.makedirs(root / "corpus" / split)
        for i in range(count):
            x = make_tiny.sway(520).numpy()
            x[1:, 1], x[1:, 2] = 0.004 * (i + 1), 0.004
            p, q = features.from_features(x)
            voice = 0.1 * random.standard_normal(520 * rig.SAMPLES_PER_FRAME)
            store.save(str(root / "corpus" / split / f"talk_{i}.safetensors"), p, rig.quat_to_mat(q), np.tile([0.3, 1.6, 2.0], (520, 1)), voice, None,
                       {"kind": "talk", "split": split, "sources": []})
    os.makedirs(root / "kept" / "corpus")
    clip = store.load(str(root / "corpus" / "test" / "talk_0.safetensors"))
    for i, start in enumerate((60, 100)):
        span = slice(start, start + place.MEASURED)
        store.rewrite(str(root / "kept" / "corpus" / f"{i:03}.safetensors"), store.Clip(clip.positions[span], clip.rotations[span], clip.user_head[span],
                                                                                       meta={"clip": "talk_0.safetensors", "first_frame": str(start), "row": "corpus"}))
    state = audio.AudioEncoder(make_tiny.AUDIO, 8).state_dict()
    common.save(str(root / "audio.pt"), ema=state, spec=make_tiny.AUDIO, features=8)
    net = Vae(3 + 36 * rig.J, **TINY["vae"])
    common.save(str(root / "vae.pt"), ema=net.state_dict(), size=TINY["vae"], mean=torch.zeros(795), std=torch.ones(795))
    call(cache, "--corpus", root / "corpus", "--vae", root / "vae.pt", "--audio", root / "audio.pt", "--out", root / "cache")
    return root


def trained(work, out, row, *more, stop=None):
    line = ["--row", row, "--corpus", work / "corpus", "--cache", work / "cache", "--out", out, "--batch", 2, "--steps", 5, "--count", 12, "--poses", 32, "--size", "tiny",
            *(["--blocks", 24] if row == "show" else []), *more]
    with pytest.MonkeyPatch.context() as patch:     # stages in this process, where the tiny size is known
        modules = {"train.vae": vae, "train.cache": cache, "train.flow": train_flow, "rivals.directions": directions}
        patch.setattr(train, "run", lambda name, line: call(modules[line[2].removeprefix("visavis_train.")], *line[3:]))
        call(train, *line, stop=stop)


from visavis_train.train import flow as train_flow  # noqa: E402


@pytest.mark.parametrize("row", ["mdm", "a2p", "show"])
def test_rivals_stop_and_go_on(work, tmp_path, row):
    few = ("--vae-steps", 2, "--vae-batch", 2)
    trained(work, tmp_path / "whole.pt", row, *few)
    trained(work, tmp_path / "parts.pt", row, *few, stop=2)
    assert common.load(tmp_path / "parts.pt")["step"] == 3
    trained(work, tmp_path / "parts.pt", row, *few, "--resume")
    assert same(common.load(tmp_path / "whole.pt"), common.load(tmp_path / "parts.pt"))


@pytest.mark.parametrize("row", train.TRAINED)
def test_every_row_makes_motion_for_the_windows(work, tmp_path, row):
    net, out = tmp_path / f"{row}.pt", tmp_path / "made"
    trained(work, net, row, "--vae-steps", 2, "--vae-batch", 2)
    line = ["--net", net, "--audio", work / "audio.pt", "--corpus", work / "corpus", "--windows", work / "kept", "--steps", 2]
    call(motion, "--row", row, *line, "--out", out)
    if row == "reference":
        call(motion, "--row", "gaze-1", *line, "--gaze", 0.8, "--out", tmp_path / "gaze")
        with pytest.raises(SystemExit):
            call(motion, "--row", "gaze-1", *line, "--out", tmp_path / "gaze")
    assert sorted(os.listdir(out)) == ["000.safetensors", "001.safetensors"]
    clip, kept = (store.load(str(folder / "000.safetensors")) for folder in (out, work / "kept" / "corpus"))
    assert clip.positions.shape == (400, rig.J, 3) and clip.rotations.shape == (400, rig.J, 4) and clip.meta == kept.meta | {"row": row}
    assert np.array_equal(clip.user_head, kept.user_head) and np.isfinite(clip.positions).all()
    parents = np.array(rig.PARENTS[1:])
    assert np.allclose(np.linalg.norm(clip.positions[:, 1:] - clip.positions[:, parents], axis=-1), np.linalg.norm(rig.OFFSETS[1:], axis=-1), atol=1e-4)
    assert np.allclose(np.linalg.norm(clip.rotations, axis=-1), 1, atol=1e-5)
    with safe_open(str(out / "000.safetensors"), framework="numpy") as f:
        assert f.metadata()["first_frame"] == "60"


def test_windows_are_cut_and_put_back_where_they_were(work, tmp_path):
    window = place.windows(str(work / "kept"), str(work / "corpus" / "test"))[1]
    clip, start = place.cut(window)
    assert window.start == 40 and len(clip.positions) == 460 and len(clip.agent_voice) == 460 * 800
    assert np.allclose(clip.positions[0, 0, [0, 2]], 0, atol=1e-6) and abs(rig.yaw_of(rig.quat_to_mat(clip.rotations[:1]))[0, 0]) < 1e-5
    place.write(str(tmp_path), "mdm", window, clip.positions.astype(np.float64), rig.quat_to_mat(clip.rotations), start)
    again, kept = store.load(str(tmp_path / window.name)), store.load(str(work / "kept" / "corpus" / window.name))
    assert np.abs(again.positions - kept.positions).max() < 1e-4 and np.abs(np.abs((again.rotations * kept.rotations).sum(-1)) - 1).max() < 1e-5
    with pytest.raises(SystemExit, match="visavis eval --keep"):
        place.windows(str(tmp_path), "anywhere")
