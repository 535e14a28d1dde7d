"""Shapes, causality, windows and streaming of the networks."""
import pytest
import torch

from visavis_train import bundle, goldens, make_tiny
from visavis_train.nets.audio import AudioEncoder
from visavis_train.nets.flow import Condition, FlowNet, absent
from visavis_train.nets.layers import band_mask
from visavis_train.nets.stream import DecoderStream, Reference, Stream, branches
from visavis_train.nets.vae import Vae


@pytest.fixture(autouse=True)
def seeded():
    torch.manual_seed(0)
    torch.set_num_threads(1)


def flow(window=5, layers=2):
    return make_tiny.lively(FlowNet(8, 6, layers=layers, width=32, heads=4, mlp=2, tau_width=16, window_blocks=window,
                                    embed_latent=16, embed_user=8, embed_voice=12, embed_gaze=4))


def conditions(b, t):
    return Condition(torch.randn(b, t, 8), torch.randn(b, t, 24), torch.randn(b, t, 24), torch.rand(b, t, 4), torch.ones(b, t, 4))


def changed(a, b):
    return ((a - b).abs().amax((0, 2)) > 1e-6).nonzero()[:, 0].tolist()


def test_band_mask_is_causal_and_ends_at_the_window():
    mask = band_mask(torch.arange(6) // 2, 2)
    assert mask[5].tolist() == [False, False, True, True, True, True]
    assert mask[4].tolist() == [False, False, True, True, True, False]


@pytest.mark.parametrize("layers", [1, 2])
def test_flow_token_reaches_its_window_and_nothing_else(layers):
    net, window = flow(3, layers), 3
    z, cond, tau = torch.randn(1, 12, 8), conditions(1, 12), torch.tensor([[0.3]])
    base = net(z, tau, cond)
    moved = z.clone()
    moved[:, 4] += 1
    assert changed(base, net(moved, tau, cond)) == list(range(4, 4 + layers * (window - 1) + 1))
    cond.user[:, 4] += 1
    assert changed(base, net(z, tau, cond)) == list(range(4, 4 + layers * (window - 1) + 1))


def test_absent_modality_has_no_effect():
    net, z, tau = flow(), torch.randn(1, 4, 8), torch.tensor([[0.5]])
    one, two = conditions(1, 4), conditions(1, 4)
    assert torch.equal(net(z, tau, one.dropped()), net(z, tau, two.dropped()))
    assert not torch.allclose(net(z, tau, one), net(z, tau, two))


def test_pair_equals_running_each_block_over_its_history():
    net, t = flow(4), 9
    history, z, cond = torch.randn(1, t, 8), torch.randn(1, t, 8), conditions(1, t)
    both = net.forward_pair(history, torch.tensor([[0.9]]), z, torch.tensor([[0.2]]), cond)
    for k in range(t):
        rows = torch.cat([history[:, :k], z[:, k:k + 1]], 1)
        tau = torch.full((1, k + 1), 0.9)
        tau[:, -1] = 0.2
        assert torch.allclose(net(rows, tau, cond.map(lambda c: c[:, :k + 1]))[:, -1], both[:, k], atol=1e-5)


@pytest.mark.parametrize("tau_history", [None, 0.9])
def test_cached_stream_equals_full_recomputation(tau_history):
    net, b, idle = flow(4), 2, 5
    conds, eps, start = conditions(b, 10), torch.randn(b, 10, 8), torch.randn(b, idle, 8)
    noise, none = torch.randn(b, idle, 8), absent(b, idle, 6)
    stream = Stream(net, b, 1.3, 2.5, gaze=True, steps=2, tau_history=tau_history, single=tau_history is not None)
    stream.warm(start, noise, none)
    references = [Reference(net, 1.3, 2.5) for _ in range(b)]
    row = lambda c, i: c.map(lambda t: t[i:i + 1])
    for i, r in enumerate(references):
        r.push(start[i:i + 1], noise[i:i + 1], branches(row(none, i), True))
    for k in range(10):
        at = conds.map(lambda t: t[:, k:k + 1])
        z = stream.step(eps[:, k:k + 1], at)
        for i, r in enumerate(references):
            e, c = eps[i:i + 1, k:k + 1], branches(row(at, i), True)
            with torch.no_grad():
                want = r.sample(e, c, 2)[0] if tau_history is None else r.single(e, c, tau_history)
            assert torch.allclose(z[i:i + 1], want, atol=2e-4), k
            r.push(z[i:i + 1], e, c)


def test_vae_shapes_causality_and_window():
    net = make_tiny.lively(Vae(75, 8, 1, 16, 2, 2, 3))
    x = torch.randn(2, 32, 75)
    y, mu, logvar = net(x, noise=False)
    assert y.shape == x.shape and mu.shape == logvar.shape == (2, 8, 8)
    moved = x.clone()
    moved[:, 9] += 1
    assert changed(mu, net.encoder(moved)[0]) == [2, 3, 4]
    z = torch.randn(1, 8, 8)
    further = z.clone()
    further[:, 3] += 1
    assert changed(net.decoder(z), net.decoder(further)) == list(range(12, 24))


def test_decoder_stream_equals_one_pass():
    net = make_tiny.lively(Vae(75, 8, 2, 16, 2, 2, 3)).decoder
    z = torch.randn(2, 9, 8)
    stream = DecoderStream(net)
    parts = [stream.step(z[:, k:k + 1]) for k in range(9)]
    assert torch.allclose(torch.cat(parts, 1), net(z), atol=1e-5)


def test_audio_streams_like_one_pass_and_is_causal():
    net = AudioEncoder(make_tiny.AUDIO, 8).eval()
    wave = torch.randn(1, 800 * 12)
    whole = net(wave)
    assert whole.shape == (1, 12, 8)
    state, parts = net.state(), []
    for chunk in wave.split([800, 2400, 800, 5600], 1):
        parts.append(net(chunk, state))
    assert torch.allclose(torch.cat(parts, 1), whole, atol=1e-5)
    moved = wave.clone()
    moved[:, 800 * 7:] += 1
    assert torch.equal(net(moved)[:, :7], whole[:, :7])
    assert not torch.allclose(net(moved)[:, 7], whole[:, 7])


def test_audio_rejects_strides_that_do_not_make_a_frame():
    with pytest.raises(ValueError):
        AudioEncoder([(1, 4, 10, 5, False)], 8)


def test_bundle_round_trip_and_goldens(tmp_path):
    tensors, config = make_tiny.build()
    path = str(tmp_path / "tiny.safetensors")
    bundle.write(path, tensors, config, half=True)
    b = bundle.read(path)
    assert torch.allclose(b.flow.input.weight, tensors["flow.input.weight"], atol=1e-3)
    conv = b.audio.conv[1].weight
    assert torch.allclose(conv.permute(0, 2, 1), tensors["audio.conv.1.weight"], atol=1e-3)
    out = goldens.compute(b, blocks=4)
    assert out["x1.3"].shape == (8, 3, 8) and out["positions"].shape == (16, 22, 3)
    assert all(torch.isfinite(v.float()).all() for v in out.values())
    assert (out["x1.3"][:, 1] - out["x1.3"][:, 2]).abs().max() > 1e-3


def test_a_student_sees_history_at_its_own_time_whatever_the_sampler_s_defaults():
    from visavis_train.nets.stream import Stream
    tensors, config = make_tiny.build()
    net = bundle.load_net("student", bundle.flow_from(config["flow"], config["vae"]["latent"], 8), tensors)
    stream = Stream(net, 1, tau_history=0.9, clean_from=0.3, single=True)
    assert stream.past(0.0) == 0.9
    late = Stream(net, 1, tau_history=0.9, clean_from=0.3)
    assert [late.past(t) for t in (0.0, 0.25, 0.375, 0.95)] == [0.0, 0.25, 0.9, 0.95]


def test_int8_bundles_are_read_as_floats():
    scale, codes = torch.rand(3) + 0.1, torch.randint(-127, 128, (3, 4, 2), dtype=torch.int8)
    read = bundle.dequantised({"audio.conv.0.weight": codes, "audio.conv.0.scale": scale, "audio.conv.0.bias": torch.ones(3)})
    assert sorted(read) == ["audio.conv.0.bias", "audio.conv.0.weight"]
    assert torch.equal(read["audio.conv.0.weight"], codes.float() * scale[:, None, None])
    with pytest.raises(ValueError, match="int4"):
        bundle.dequantised({"audio.out.weight": codes[:, :, 0].to(torch.uint8), "audio.out.scale": scale.half()})
