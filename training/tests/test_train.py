"""Training pieces on synthetic motion: representation, losses, windows, teacher, export."""
import math

import numpy as np
import pytest
import torch

from visavis_train import bundle, make_tiny
from visavis_train.motion import features, rig
from visavis_train.nets.audio import AudioEncoder
from visavis_train.nets.flow import GAZE, USER, Condition, FlowNet, sound_width
from visavis_train.nets.stream import Reference, branches
from visavis_train.nets.vae import Vae
from visavis_train.train import audio, cache, common, data, flow, geometry, grow, student, vae, windows


@pytest.fixture(autouse=True)
def seeded():
    torch.manual_seed(0)
    torch.set_num_threads(1)


def walker(frames=160):
    """A body that walks a curve while it sways: world positions [T, J, 3] and quaternions [T, J, 4]."""
    x = make_tiny.sway(frames)
    x[1:, 0], x[1:, 1], x[1:, 2] = 0.004, 0.02, 0.01
    return features.from_features(x.numpy())


def small_flow():
    return make_tiny.lively(FlowNet(8, 6, layers=2, width=32, heads=4, mlp=2, tau_width=16, window_blocks=5, embed_latent=16, embed_user=8,
                                    embed_voice=12, embed_gaze=4))


def made_windows(tmp_path, blocks=16, clips=2, frames=160, latent=8, names="talk", **kw):
    """Windows of a cache of `clips` walks with random latents and features; the second voice is absent. `names`: the clips' kind."""
    p, q = walker(frames)
    roots = torch.from_numpy(data.compact(p, q)[1])
    rows, segments = [], []
    for i in range(clips):
        for phase in cache.PHASES:
            n = (frames - phase) // 4
            segments.append((i, i * frames + phase, sum(map(len, rows)), n))
            rows.append(torch.randn(n, latent))
    total = clips * frames
    path = str(tmp_path / "train.pt")
    torch.save({"names": [f"{names}_{i}" for i in range(clips)], "starts": torch.arange(clips + 1) * frames, "has": torch.tensor([[True, False]] * clips),
                "roots": roots.repeat(clips, 1), "user": torch.randn(total, 3) + 2, "gaze": torch.rand(total), "agent": torch.randn(total, 6).half(),
                "voice": torch.randn(total, 6).half(), "still": torch.arange(total) % 8 < 4, "z": torch.cat(rows), "segments": torch.tensor(segments), "latent_mean": torch.zeros(latent),
                "latent_std": torch.ones(latent)}, path)
    return windows.Windows(path, blocks, **kw)


def test_a_user_who_is_seen_aside_is_told_from_one_in_front_or_unseen():
    angle = torch.tensor([0.0, 0.5, 0.7, -0.7, 3.1, 0.7])
    user = torch.stack([angle.sin(), angle.cos()], -1).repeat(1, 4)[None]
    flags = torch.ones(1, 6, 4)
    flags[0, 5, 0] = 0
    cond = windows.Condition(user, None, None, None, flags)
    assert windows.aside(cond)[0].tolist() == [0, 0, 1, 1, 1, 0]


def test_compact_frames_expand_to_the_feature_vector():
    p, q = walker()
    c, roots = data.compact(p, q)
    assert np.allclose(data.expand(torch.from_numpy(c)).numpy(), features.to_features(p, q), atol=1e-5)
    assert np.allclose(roots[:, :2], p[:, 0, [0, 2]], atol=1e-6)


def test_integrated_roots_and_positions_equal_the_world():
    p, q = walker()
    x = torch.from_numpy(features.to_features(p, q)).float()
    _, roots = data.compact(p, q)
    start = torch.from_numpy(roots[0]).float()
    path = geometry.integrate(x[1:, :3], start)
    assert np.allclose(path.numpy(), roots[1:], atol=1e-3)
    assert np.allclose(geometry.to_world(path, geometry.local_positions(x[1:])).numpy(), p[1:], atol=2e-3)


def test_user_in_the_agents_frame_and_back():
    roots = torch.tensor([[1.0, -2.0, math.pi / 2]])
    local = geometry.to_local(roots, torch.tensor([[[3.0, -2.0]]]))
    assert torch.allclose(local, torch.tensor([[[0.0, 2.0]]]), atol=1e-6)  # facing +X, a user at +X is straight ahead
    world = geometry.to_world(roots, torch.tensor([[[0.0, 0.0, 2.0]]]))
    assert torch.allclose(world, torch.tensor([[[3.0, 0.0, -2.0]]]), atol=1e-6)


def test_gaze_equals_the_corpus_definition():
    p, q = walker()
    c, roots = data.compact(p, q)
    user = np.tile([0.5, 1.6, 2.0], (len(p), 1))
    want = rig.gaze_score(p, rig.quat_to_mat(q), user)
    got = geometry.gaze(torch.from_numpy(roots).float(), data.expand(torch.from_numpy(c)), torch.from_numpy(user).float(), rig.EYES, rig.HEAD_BACK)
    assert np.allclose(got.numpy(), want, atol=1e-3)


def test_vae_losses_vanish_for_a_perfect_reconstruction_and_see_the_root():
    x = make_tiny.sway(64)[None]
    mean, std = x[0].mean(0), torch.full((x.shape[-1],), 0.05)
    s = (x - mean) / std
    w, jw = vae.channel_weights(x.shape[-1]), vae.joint_weights(22)
    mu = logvar = torch.zeros(1, 16, 4)
    parts = vae.losses(s, s, mean, std, mu, logvar, w, jw)
    assert parts["feature"] == 0 and parts["kl"] == 0 and parts["position"] < 1e-2
    moved = s.clone()
    moved[..., 2] += 0.02 / 0.05
    assert vae.losses(s, moved, mean, std, mu, logvar, w, jw)["position"] > parts["position"] + 0.1


def test_principal_start_reconstructs_better_than_chance():
    x = make_tiny.sway(400)
    mean, std = x.mean(0), torch.full((x.shape[-1],), 0.05)
    s, net = (x - mean) / std, Vae(x.shape[-1], 4, 1, 32, 4, 2, 4)
    vae.start_from_principal(net, s, vae.channel_weights(x.shape[-1]))
    code = net.encoder.frame(s)
    assert code.shape == (400, 32) and code.std() > 0.1
    basis = net.decoder.out.weight
    shape = torch.linalg.lstsq(basis, s.T).solution
    assert (basis @ shape - s.T).square().mean() < 0.05 * s.square().mean()


def test_windows_delay_the_user_one_block_and_mark_absent_voices(tmp_path):
    w = made_windows(tmp_path, drop=0, drop_all=0, drop_gaze=0, prefix=0, jitter=False)
    segment = w.segments[3:4]  # the second clip at the second phase
    z, cond = w.read(segment, torch.tensor([3]))
    first = 160 + cache.PHASES[1] + 12
    assert torch.equal(z[0], w.z[int(segment[0, 2]) + 3:][:16])
    assert torch.equal(cond.agent[0, 0], w.agent[first:first + 4].float().reshape(-1))
    assert torch.equal(cond.voice[0, 1], w.voice[first:first + 4].float().reshape(-1))
    want = geometry.to_local(w.roots[first - 1], w.user[first - 4:first][:, [0, 2]].double()).float()
    assert torch.allclose(cond.user[0, 0], want.flatten(), atol=1e-6)
    assert cond.flags[0, 5].tolist() == [1, 1, 0, 1]


def test_windows_stay_in_their_clip(tmp_path):
    w = made_windows(tmp_path, blocks=38)  # of 39 and 38 blocks
    for _ in range(20):
        segment, at = w.draw(4)
        frames = w.frames(segment, at)
        clip = segment[:, :1]
        assert ((frames >= 160 * clip) & (frames < 160 * (clip + 1))).all()


def test_voices_that_are_heard_in_training_give_the_features_of_the_whole_clip(tmp_path):
    encoder = AudioEncoder([(1, 4, 10, 5, False), (4, 4, 10, 5, False), (4, 4, 8, 4, False), (4, 4, 8, 4, False), (4, 6, 4, 2, False), (6, 6, 3, 1, True)], 6)
    w = made_windows(tmp_path, drop=0, drop_all=0, drop_gaze=0, prefix=0, jitter=False)
    w.audio, w.voices = encoder, (torch.randn(320, 2, 800) * 3000).short()
    w.has = torch.ones(2, 2)
    place = w.draw(8)
    cond = w.batch(8, place)[1]
    for row, (segment, at) in enumerate(zip(*place)):
        clip, first = int(segment[0]), int(segment[1] + 4 * at)
        with torch.no_grad():
            whole = encoder(w.voices[160 * clip:160 * (clip + 1)].permute(1, 0, 2).reshape(2, -1).float() / 32768)
        for heard, who, start in ((cond.agent, 0, first), (cond.voice, 1, first - 4)):
            want = whole[who, start - 160 * clip:][:64].reshape(16, -1)
            assert torch.allclose(heard[row], want, atol=0.02 * float(want.abs().max()))
    w.live = 3
    some = w.batch(8, place)[1].agent
    assert torch.equal(some[:3], cond.agent[:3]) and not torch.allclose(some[3:], cond.agent[3:])
    cond.agent.square().mean().backward()
    assert encoder.conv[0].weight.grad.abs().max() > 0


def test_dropout_clears_flags_at_about_its_rate(tmp_path):
    w = made_windows(tmp_path, drop=0.05, drop_all=0.1, drop_gaze=0.35, prefix=0.0)
    flags = torch.cat([w.batch(64)[1].flags for _ in range(8)])
    assert 0.75 < flags[..., 0].mean() < 0.95 and 0.45 < flags[..., GAZE].mean() < 0.72 and flags[..., 2].sum() == 0


def test_a_voice_that_a_clip_lacks_is_heard_to_be_silent_in_some_windows(tmp_path):
    w = made_windows(tmp_path, drop=0, drop_all=0, drop_gaze=0, prefix=0, quiet=0.4)
    agent, user = (torch.cat([w.batch(64)[1].flags[..., 1:3] for _ in range(8)])).unbind(-1)
    assert agent.all() and 0.3 < user.mean() < 0.5 and (user == user[:, :1]).all()


@pytest.mark.parametrize("kind", ["pair", "walk"])
def test_nobody_is_heard_to_be_silent_where_people_dance_or_wander(tmp_path, kind):
    w = made_windows(tmp_path, names=kind, drop=0, drop_all=0, drop_gaze=0, prefix=0, quiet=1.0)
    flags = w.batch(32)[1].flags
    assert flags[..., 1].all() and not flags[..., 2].any()


def test_a_user_who_is_away_is_not_seen_all_along_or_in_part(tmp_path):
    w = made_windows(tmp_path, drop=0, drop_all=0, drop_gaze=0, prefix=0, away=0.5)
    seen = torch.cat([w.batch(64)[1].flags[..., USER] for _ in range(8)])
    share = seen.mean(1)
    whole, none = (share == 1).float().mean(), (share == 0).float().mean()
    assert 0.4 < whole < 0.6 and 0.25 < none < 0.42
    changes = seen.diff(dim=1).abs().sum(1)
    assert (changes[(share > 0) & (share < 1)] == 1).all() and (seen[:, 0] > seen[:, -1]).any() and (seen[:, 0] < seen[:, -1]).any()
    w.away = 0
    assert w.batch(64)[1].flags[..., USER].all()


def test_teacher_over_a_window_equals_sampling_block_by_block():
    net, t = small_flow(), 7
    history, eps = torch.randn(1, t, 8), torch.randn(1, t, 8)
    cond = Condition(torch.randn(1, t, 8), torch.randn(1, t, 24), torch.randn(1, t, 24), torch.rand(1, t, 4), torch.ones(1, t, 4))
    got = student.teach(net, history, eps, cond, True, 1.3, 2.5, steps=2)
    r = Reference(net, 1.3, 2.5)
    at = lambda k: branches(cond.map(lambda c: c[:, k:k + 1]), True)
    r.push(history[:, :1], eps[:, :1], at(0))
    for k in range(1, t):
        with torch.no_grad():
            want = r.sample(eps[:, k:k + 1], at(k), 2)[0]
        assert (got[:, k:k + 1] - want).abs().max() < 0.15 * want.abs().max()  # bf16 against fp32
        r.push(history[:, k:k + 1], eps[:, k:k + 1], at(k))


def test_rotations_apart_is_the_angle():
    p, q = walker(8)
    turned = rig.quat_to_mat(q)
    turned[:, 5] = turned[:, 5] @ rig.axis_mat("x", 0.08)
    a = torch.from_numpy(features.to_features(p, q)).float()
    b = torch.from_numpy(features.to_features(p, rig.mat_to_quat(turned))).float()
    angle = vae.rotations_apart(a, b)
    assert torch.allclose(angle[:, 5], torch.full((8,), 0.08), atol=2e-4)
    assert angle[:, [j for j in range(22) if j != 5]].max() < 1e-3


def test_flow_losses_fall_when_trained(tmp_path):
    w, net = made_windows(tmp_path), FlowNet(8, 6, layers=1, width=32, heads=4, mlp=2, tau_width=16, window_blocks=5, embed_latent=16,
                                             embed_user=8, embed_voice=12, embed_gaze=4)
    optim, metric, seen = common.optimiser(net, 3e-3), torch.eye(8), []
    for step in range(60):
        z, cond = w.batch(8)
        loss = (flow.shared_loss if step % 2 else flow.apart_loss)(net, z, cond, metric, 0.1, 1.0, 0)
        optim.zero_grad()
        loss.backward()
        optim.step()
        seen.append(loss.item())
    assert sum(seen[-10:]) < 0.9 * sum(seen[:10])


def test_a_grown_flow_does_what_the_narrow_one_does_and_its_halves_learn_apart():
    size = dict(layers=2, width=32, heads=4, mlp=2, tau_width=16, window_blocks=5, embed_latent=16, embed_user=8, embed_voice=12, embed_gaze=4)
    net = make_tiny.lively(FlowNet(8, 6, **size, sound_features=5))
    torch.nn.init.normal_(net.input_sound.weight)
    wide, sizes = grow.grow(net, size, 3)
    assert (sizes["width"], sizes["heads"], sizes["layers"], len(wide.layers)) == (64, 8, 3, 3)
    cond = Condition(torch.randn(2, 9, 8), torch.randn(2, 9, 24), torch.randn(2, 9, 24), torch.rand(2, 9, 4), torch.ones(2, 9, 4),
                     torch.randn(2, 9, sound_width(5)), torch.ones(2, 9, 1))
    z, past, tau = torch.randn(2, 9, 8), torch.randn(2, 9, 8), torch.full((2, 1), 0.4)
    run = lambda n: n.forward_pair(past, torch.full((2, 1), 0.9), z, tau, cond)
    assert torch.allclose(run(wide), run(net), atol=2e-5) and run(net).std() > 0.01
    run(wide).square().mean().backward()
    one, other = wide.layers[0].fc1.weight.grad.chunk(2)
    assert (one - other).norm() > 0.1 * one.norm()
    assert wide.layers[2].mod.weight.grad.norm() > 0  # the gates of the new layer open
    with pytest.raises(SystemExit, match="--layers"):
        grow.grow(net, size, 1)


def test_late_weights_are_one_on_average_and_weigh_velocities_alike():
    tau = (torch.arange(100000) + 0.5) / 100000
    for late in (0, 0.5, 1, 2):
        assert flow.late_weight(tau, late).mean().item() == pytest.approx(1, abs=1e-3)
    w = flow.late_weight(torch.tensor([0.0, 0.5, 0.9, 0.99]), 2)
    assert (w[1] / w[0]).item() == pytest.approx(4, rel=1e-4) and w[2].item() == pytest.approx(w[3].item(), rel=1e-4)


def test_still_blocks_are_found(tmp_path):
    w = made_windows(tmp_path)
    segment, at = w.draw(3)
    first = segment[:, 1] + 4 * at
    want = torch.tensor([[(torch.arange(f + 4 * k, f + 4 * k + 4) % 8 < 4).float().mean() for k in range(16)] for f in first.tolist()])
    assert torch.equal(w.stillness(segment, at), want)


def test_a_rough_latent_space_costs_nothing_unless_asked_for():
    net, x = make_tiny.lively(Vae(75, 8, 1, 16, 2, 2, 3)), torch.randn(2, 16, 75)
    torch.manual_seed(1)
    plain = net(x)[0]
    torch.manual_seed(1)
    assert torch.equal(net(x, rough=0.0)[0], plain)
    apart = [(net(x, noise=False, rough=r)[0] - net(x, noise=False)[0]).square().mean().item() for r in (0.1, 1.0)]
    assert 0 < apart[0] < apart[1]


def test_audio_targets_hear_pitch_and_loudness():
    t = torch.arange(24000) / 24000
    tone = lambda f: sum((2 * math.pi * f * h * t).sin() / h for h in range(1, 8))[None] * 0.1
    low, high = audio.targets(tone(110.0))[0, 10], audio.targets(tone(220.0))[0, 10]
    assert abs((high[-1] - low[-1]) / 2 - math.log(2)) < 0.1 and low[-2] > 1
    assert audio.targets(tone(110.0) * 0.1)[0, 10, -4] < low[-4] - 1
    assert audio.targets(torch.zeros(1, 8000)).abs().max() < 4


def test_audio_standardise_gives_unit_features():
    net = make_tiny.lively(AudioEncoder(make_tiny.AUDIO, 8), 1.6)
    wave = 0.1 * torch.randn(8, 800 * 30)
    audio.standardise(net, wave)
    y = net(wave).detach().flatten(0, 1)
    assert torch.allclose(y.mean(0), torch.zeros(8), atol=1e-3) and torch.allclose(y.std(0), torch.ones(8), atol=1e-2)


def test_rate_rises_then_falls():
    assert common.rate(1.0, 0, 0.0, 100) < common.rate(1.0, 99, 0.0, 100) == 1.0
    assert common.rate(1.0, 1000, 1.0, 100) == pytest.approx(0.02)


def test_loading_a_bundle_says_what_is_missing(tmp_path):
    tensors, config = make_tiny.build()
    del tensors["flow.layers.1.qkv.weight"]
    path = str(tmp_path / "b.safetensors")
    bundle.write(path, tensors, config)
    with pytest.raises(KeyError, match="flow.layers.1.qkv.weight"):
        bundle.read(path)
