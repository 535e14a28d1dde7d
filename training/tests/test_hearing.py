"""Hearing: ears that move with the head, sound vectors, networks with and without sounds, interrupted conversations, their windows."""
import json
import os
from dataclasses import replace

import numpy as np
import pytest
import torch
from safetensors.torch import load_file
from standins import fake_sources

from visavis_train import bundle as bundles
from visavis_train import goldens
from visavis_train.corpus import plausible, simulate, store
from visavis_train.hearing import appraise, corpus, ears, rooms, variety
from visavis_train.hearing.events import Event, Room
from visavis_train.mospa.react import REACTIONS
from visavis_train.nets.appraisal import Appraisal
from visavis_train.nets.audio import AudioEncoder
from visavis_train.nets.flow import Condition, FlowNet, absent, sound_width
from visavis_train.train import cache, common, windows
from visavis_train.train.flow import widened

GOLDENS = os.path.join(os.path.dirname(__file__), "..", "..", "tests", "goldens")
SMALL = [(1, 4, 10, 5, False), (4, 8, 10, 5, False), (8, 8, 8, 4, False), (8, 8, 8, 4, False), (8, 8, 4, 2, False)]


def heads(frames, yaw=0.0):
    left = np.array([np.cos(yaw), 0.0, -np.sin(yaw)])
    return np.tile([0.0, 1.6, 0.0], (frames, 1)), np.tile(left, (frames, 1))


def source(*place, first=0, frames=6, seed=0):
    return ears.Source(first, np.random.default_rng(seed).standard_normal(800 * frames), np.array(place, float))


def test_a_source_ahead_is_heard_alike_and_one_at_the_side_earlier_and_louder():
    ahead = ears.hear([source(0, 1.6, 2)], *heads(6))
    assert np.allclose(ahead.ears[0], ahead.ears[1])
    left = ears.hear([source(2, 1.6, 0)], *heads(6))
    assert left.levels[3, 0] > left.levels[3, 1] + 0.1
    x, y = left.ears[:, 1600:4000]
    lag = np.argmax([np.dot(x[40:-40], np.roll(y, -k)[40:-40]) for k in range(40)])
    assert abs(lag - ears.RADIUS * (1 + np.pi / 2) / ears.SOUND * ears.RATE) < 1.0     # Woodworth: 15.7 samples
    turned = ears.hear([source(2, 1.6, 0)], *heads(6, np.pi / 2))                          # who turns there hears it ahead
    assert np.allclose(turned.ears[0], turned.ears[1], atol=1e-6)


def test_twice_as_far_is_6_db_quieter_and_nearer_than_the_head_is_bounded():
    near, far = (ears.hear([source(0, 1.6, z)], *heads(6)).levels[3, 0] * 20 for z in (1.5, 3.0))
    assert abs(near - far - 6.02) < 0.05
    inside = ears.hear([source(0, 1.6, 0)], *heads(6))
    assert np.isfinite(inside.ears).all() and np.abs(inside.ears).max() < 10 / ears.NEAREST


def test_what_sounds_counts_more_than_what_has_sounded_and_places_are_held():
    loud, soft = source(0, 1.6, 2, frames=4), source(-2, 1.6, 0, first=12, frames=6)
    soft.wave *= 0.5
    h = ears.hear([loud, soft], *heads(180))
    assert h.known[0] and (h.place[:10] == loud.place).all() and (h.place[14:60] == soft.place).all()
    silent = np.flatnonzero(~h.known)[0]
    end = 17 + (94 + 20 * np.log10(0.5) - 6.02 - ears.KNOWN) / ears.FALL
    assert abs(silent - (end + ears.HOLD)) < 3 and (h.place[silent:] == 0).all()
    assert not ears.hear([], *heads(5)).known.any()


def test_a_sound_vector_tells_the_bearing_from_where_the_agent_stands():
    encoder = AudioEncoder(SMALL, 3)
    f = ears.listen(encoder, torch.zeros(3200))[None]
    root = torch.tensor([[1.0, 2.0, np.pi / 2]], dtype=torch.float64)                      # facing +X
    v = ears.vector(f, torch.zeros(1, 4, 2), torch.tensor([[3.0, 0.5, 2.0]]), torch.tensor([True]), root, torch.tensor([-1.0]))[0]
    assert len(v) == sound_width(3) and torch.allclose(v[-6:], torch.tensor([1.0, 0.0, 1.0, 0.0, -1.0, -1.0]), atol=1e-6)
    unknown = ears.vector(f, torch.zeros(1, 4, 2), torch.tensor([[3.0, 0.5, 2.0]]), torch.tensor([False]), root, torch.tensor([0.5]))[0]
    assert (unknown[-6:-1] == 0).all() and unknown[-1] == 0.5
    here = ears.vector(f, torch.zeros(1, 4, 2), torch.tensor([[1.0, 1.5, 2.0]]), torch.tensor([True]), root, torch.tensor([0.0]))[0]
    assert torch.isfinite(here).all()


SIZE = dict(layers=1, width=32, heads=4, mlp=2, tau_width=16, window_blocks=6, embed_latent=16, embed_user=8, embed_voice=8, embed_gaze=4)


def nets():
    torch.manual_seed(0)
    plain, hearing = FlowNet(8, 4, **SIZE), FlowNet(8, 4, **SIZE, sound_features=3, embed_sound=8)
    hearing.load_state_dict(plain.state_dict(), strict=False)
    torch.nn.init.normal_(hearing.input_sound.weight)
    return plain, hearing


def test_without_sounds_a_network_computes_what_it_did_and_with_them_something_else():
    plain, hearing = nets()
    z, tau = torch.randn(2, 5, 8), torch.full((2, 1), 0.5)
    cond = Condition(torch.randn(2, 5, 8), torch.randn(2, 5, 16), torch.randn(2, 5, 16), torch.rand(2, 5, 4), torch.ones(2, 5, 4))
    sound = Condition(*cond.parts()[:5], torch.randn(2, 5, sound_width(3)), torch.zeros(2, 5, 1))
    want = plain(z, tau, cond)
    assert torch.equal(hearing(z, tau, cond), want) and torch.equal(hearing(z, tau, sound), want)
    sound.heard[:, 3] = 1
    got = hearing(z, tau, sound)
    assert torch.equal(got[:, :3], want[:, :3]) and (got[:, 3:] - want[:, 3:]).abs().max() > 1e-3
    assert torch.equal(hearing(z, tau, sound.dropped()), plain(z, tau, cond.dropped())) and sound.dropped(3).heard is sound.heard
    assert absent(2, 3, 4, sound_features=3).heard.shape == (2, 3, 1) and absent(2, 3, 4).sound is None


def test_an_appraisal_keeps_its_weights_in_a_bundle_and_stands_behind_the_features():
    torch.manual_seed(4)
    net, other = (Appraisal(6, ("stay", "run"), 8) for _ in range(2))
    features, levels = torch.randn(9, 6), torch.randn(9, 2)
    told = net.behind(features, levels, 0.5)
    assert told.shape == (9, 8) and torch.equal(told[:, :6], features) and torch.allclose(told[:, 6:].sum(1), torch.ones(9))
    assert torch.allclose(net.behind(features[:5], levels[:5], 0.5), told[:5]), "what comes does not change what was"
    assert not torch.allclose(net.behind(features, levels, -1.0), told)
    assert torch.allclose(other.fill(net.tensors()).behind(features, levels, 0.5), told, atol=1e-6)


def test_a_network_that_is_told_more_computes_what_it_did_until_it_has_learnt_more():
    _, before = nets()
    after = FlowNet(8, 4, **SIZE, sound_features=5, embed_sound=8)
    after.load_state_dict(widened(before.state_dict(), 3, 5))
    z, tau, cond = torch.randn(2, 5, 8), torch.full((2, 1), 0.5), absent(2, 5, 4, sound_features=3)
    cond.heard += 1
    few = torch.randn(2, 5, sound_width(3))
    more = torch.cat([torch.cat([few[..., :12].unflatten(-1, (4, 3)), torch.randn(2, 5, 4, 2)], -1).flatten(-2), few[..., 12:]], -1)
    want = before(z, tau, replace(cond, sound=few))
    assert torch.allclose(after(z, tau, replace(cond, sound=more)), want, atol=1e-6)


def test_the_tiny_bundle_hears_what_the_goldens_say():
    b = bundles.read(os.path.join(GOLDENS, "hearing.safetensors"))
    told, again = load_file(os.path.join(GOLDENS, "hearing.out.safetensors")), goldens.compute(b)
    assert set(told) == set(again)
    for name in ("hearing.ears", "hearing.levels", "hearing.place", "conditioning.sound", "latents", "student"):
        assert (told[name] - again[name]).abs().max() < 1e-3, name


class Sounds:
    """Noise bursts under the classes' names."""

    def draw(self, rng, kind):
        return rng.standard_normal(24000 * 2), f"made/{kind}"


def interrupted(seed=3, frames=1500, genre="sensitive", classes=None):
    rng = np.random.default_rng(seed)
    room = Room(rng, frames, Sounds(), [], genre, classes)
    return simulate.simulate_clip(rng, frames, fake_sources(), 0.2, 0.1, False, room), room


@pytest.mark.parametrize("kind, genre, reaction", [("phone", "dull", "look"), ("glass", "neutral", "flinch"), ("crowd", "sensitive", "cover"), ("shot", "neutral", "run"), ("rain", "dull", "stay")])
def test_a_reaction_is_seen_after_its_onset_and_then_the_conversation_has_the_body_back(kind, genre, reaction):
    clip, room = interrupted(5, genre=genre, classes=[kind])
    assert not plausible.faults(clip.positions, clip.rotations, corpus.STARTLED)
    middle, left = ears.centre(clip.positions, clip.rotations)
    ahead = np.cross(left, [0, 1, 0])
    for e in room.events:
        assert e.reaction == reaction and e.begin >= e.onset and (reaction == "stay" or e.begin - e.onset >= 4)
        if reaction == "look" and e.onset + 60 < len(middle):
            d = e.place - middle[e.onset + 50]
            assert np.dot(ahead[e.onset + 50], d / np.linalg.norm(d)) > 0.8
        if reaction == "cover" and e.begin + 40 < len(middle):
            hands = clip.positions[e.begin + 30][[9, 13]]
            assert np.linalg.norm(hands - clip.positions[e.begin + 30, ears.HEAD], axis=-1).max() < 0.35
        if reaction == "run" and e.begin + 70 < len(middle):
            far = lambda t: np.linalg.norm((clip.positions[t, 0] - e.place)[[0, 2]])
            assert far(e.begin + 60) > far(e.onset) + 0.8


def test_conversations_without_a_room_are_what_they_were():
    rng = lambda: np.random.default_rng(1)
    one, two = (simulate.simulate_clip(rng(), 600, fake_sources(), 0.3, 0.3, False, room) for room in (None, None))
    quiet = Room(np.random.default_rng(9), 80, Sounds(), [])
    assert not quiet.events
    three = simulate.simulate_clip(rng(), 600, fake_sources(), 0.3, 0.3, False, quiet_room())
    assert np.array_equal(one.positions, two.positions) and np.array_equal(one.positions, three.positions)


def quiet_room():
    room = Room(np.random.default_rng(9), 600, Sounds(), [])
    room.events = []
    return room


def write_cache(path, hears, clips=2, frames=400):
    """A cache of random numbers, with sounds in it or without."""
    torch.manual_seed(int(hears))
    n = clips * frames
    starts = torch.arange(clips + 1) * frames
    segments = torch.tensor([[i, i * frames + 4, i * (frames // 4 - 1), frames // 4 - 1] for i in range(clips)])
    state = dict(names=[f"{'hear' if hears else 'talk'}_{i}" for i in range(clips)], starts=starts, has=torch.ones(clips, 2), still=torch.zeros(n, dtype=torch.bool),
                 roots=torch.randn(n, 3, dtype=torch.float64), user=torch.randn(n, 3), gaze=torch.rand(n), agent=torch.randn(n, 4).half(), voice=torch.randn(n, 4).half(),
                 z=torch.randn(int(segments[:, 3].sum()), 8), segments=segments, latent_mean=torch.zeros(8), latent_std=torch.ones(8))
    if hears:
        levels = torch.full((n, 2), float(ears.SILENT))
        levels[100:130] = 0.5
        levels[500:530] = 0.5
        known = levels[:, 0] > 0
        state |= dict(sound=torch.randn(n, 3).half(), levels=levels, source=torch.randn(n, 3), known=known, reacts=known, hears=torch.ones(clips, dtype=torch.bool),
                      sensitivity=torch.tensor([-1.0, 1.0]), silence=torch.full((3,), 0.25))
    os.makedirs(path, exist_ok=True)
    for split in ("train", "val"):
        common.save(os.path.join(path, split + ".pt"), **state)


def test_joined_caches_give_windows_of_both_and_flags_as_sessions_have_them(tmp_path):
    write_cache(tmp_path / "a", False)
    write_cache(tmp_path / "b", True)
    joined = cache.join([tmp_path / "a", tmp_path / "b"], "train")
    assert joined["names"] == ["talk_0", "talk_1", "hear_0", "hear_1"] and joined["starts"].tolist() == [0, 400, 800, 1200, 1600]
    os.makedirs(tmp_path / "c")
    common.save(str(tmp_path / "c" / "train.pt"), **joined)
    w = windows.Windows(str(tmp_path / "c" / "train.pt"), 32, sounds=2.0)
    assert w.sound_features == 3 and (w.weights[2:] == 2 * w.weights[:2]).all()
    quiet, loud = (w.segments[w.segments[:, 0] == c][:1].repeat(64, 1) for c in (0, 2))
    at = torch.full((64,), 10)
    z, cond = w.read(quiet, at)
    assert (cond.heard == 0).all() and torch.allclose(cond.sound[..., :12], torch.tensor(0.25)) and (cond.sound[..., -6:-1] == 0).all()
    z, cond = w.read(loud, at)
    first = (100 - 4 - 40) // 4 + 1           # the block after the one in which the sound begins
    assert (cond.heard == 1).all() and (cond.sound[:, :first, -6] == 0).all() and (cond.sound[:, first + 1, -6] == 1).all()
    torch.manual_seed(0)
    sound, heard = w.overheard(cond.sound, cond.heard, loud)
    begins = heard[:, :, 0].argmax(1)
    assert set(begins.tolist()) == {0, first} and (heard[:, first:] == 1).all()
    sound, heard = w.overheard(*(lambda c: (c.sound, c.heard))(w.read(quiet, at)[1]), quiet)
    assert set(heard[:, 0, 0].tolist()) == {0.0, 1.0} and (heard == heard[:, :1]).all() and set(sound[:, 0, -1].tolist()) == {-1.0, 0.0, 1.0}


def test_a_target_of_the_gaze_is_for_conversation(tmp_path):
    """Where the body reacts, the cached gaze score is the mean of the rest of the clip."""
    folder = tmp_path / "corpus" / "train"
    os.makedirs(folder)
    clip, room = interrupted(7, 900)
    store.save(str(folder / "hear_0.safetensors"), clip.positions, clip.rotations, clip.user, clip.agent_voice, clip.user_voice, {"kind": "talk", "sources": ["made/x"], "split": "train"})
    for e in room.events:
        e.place = store.to_session(clip.positions, clip.rotations, e.place[None])[2][0]
    moved, turned, _ = store.to_session(clip.positions, clip.rotations, clip.user)
    np.savez(folder / "hear_0.npz", **corpus.heard_in(moved, turned, room))
    clips = cache.Split(str(tmp_path / "corpus"), "train")
    kept = cache.rooms(clips, AudioEncoder(SMALL, 3).eval(), clips.gaze)
    reacts = torch.tensor(np.load(folder / "hear_0.npz")["reacts"])
    assert reacts.any() and kept["gaze"][reacts].std() < 1e-6 and torch.equal(kept["gaze"][~reacts], clips.gaze[~reacts])
    assert kept["sound"].shape == (900, 3) and kept["known"].any() and kept["levels"].min() > -2


def test_a_varied_sound_is_as_loud_as_before_and_another_one_each_time():
    y = np.random.default_rng(0).standard_normal(24000)
    several = [variety.varied(np.random.default_rng(i), y) for i in range(8)]
    assert len({len(v) for v in several}) > 3 and all(0.79 * len(y) <= len(v) <= 1.26 * len(y) for v in several)
    assert np.allclose([np.sqrt(np.square(v).mean()) for v in several], np.sqrt(np.square(y).mean()), rtol=1e-3)
    bright = [np.abs(np.diff(v)).mean() for v in several]
    assert max(bright) > 1.2 * min(bright)


def test_rooms_have_sounds_where_their_events_say_and_streams_learn_from_them(tmp_path):
    made, h = rooms.room(np.random.default_rng(4), Sounds(), "sensitive")
    assert len(made.events) >= 2
    for e in made.events:
        assert h.levels[e.onset + 2].max() > h.levels[e.onset - 2].max() + 0.5
    events = [{k: getattr(e, k) for k in ("reaction", "onset", "end", "until")} for e in made.events]
    path = str(tmp_path / "rooms.pt")
    common.save(path, sound=torch.zeros(rooms.FRAMES, 3).half(), levels=torch.tensor(h.levels), sensitivity=torch.tensor([1.0]), starts=torch.tensor([0, rooms.FRAMES]), events=json.dumps([events]))
    streams = appraise.Streams.of_rooms(path)
    first = made.events[0]
    assert (streams.label[:first.onset] == 0).all() and (streams.label[first.onset:first.until] == REACTIONS.index(first.reaction)).all()
    assert (streams.count[first.onset:first.onset + appraise.LEAVE] == 0).all() and streams.count[first.onset + appraise.LEAVE] == 4
    x, label, count = streams.batch(5)
    assert x.shape == (5, appraise.FRAMES, 6) and label.shape == count.shape == (5, appraise.FRAMES) and (x[..., -1] == 1).all()


def test_what_calls_for_a_reaction_is_all_but_the_first_share():
    frames = torch.zeros(2, 4, 5)
    frames[0, :, 3], frames[1, :2, 3], frames[1, :, 4] = 1.0, 0.5, 0.5
    sound = torch.cat([frames.flatten(1), torch.randn(2, 14)], 1)
    assert torch.allclose(ears.called(sound, 5, 2), torch.tensor([0.0, 0.75]))
    assert ears.called(sound[:, None].expand(-1, 3, -1), 5, 2).shape == (2, 3)


def test_a_cache_is_appraised_as_a_stream_is(tmp_path):
    write_cache(tmp_path / "heard", True)
    state, net = common.load(str(tmp_path / "heard" / "train.pt")), Appraisal(3, REACTIONS, width=8).eval()
    made = cache.appraised(state, net)
    assert made["sound"].shape == (800, 3 + len(REACTIONS)) and torch.equal(made["sound"][:, :3], state["sound"])
    later = net.behind(state["sound"][400:].float(), state["levels"][400:], 1.0)         # the second clip, from its own beginning
    assert torch.allclose(made["sound"][400:].float(), later, atol=2e-3)
    assert made["silence"].shape == (3 + len(REACTIONS),) and abs(made["silence"][3:].sum() - 1) < 1e-5
    assert torch.equal(made["z"], state["z"]) and torch.equal(made["levels"], state["levels"])
