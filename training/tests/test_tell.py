"""The classifier of generated motion, and what rests weigh."""
import torch

from visavis_train import make_tiny
from visavis_train.motion import rig
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
    x = bodies(6)
    shaking = x + 0.02 * torch.randn(x.shape, generator=torch.Generator().manual_seed(0))
    told = tell.told(windows(x), windows(shaking), steps=60, nets=1)
    same = tell.told(windows(x), windows(x), steps=60, nets=1)
    assert told.shape == windows(x).shape[:2]
    other = tell.told(windows(x), windows(x.roll(2, 0)), steps=60, nets=1)
    assert told.mean() > 0.95 and same.mean() == 0.5
    assert abs(other.mean() - 0.5) < 1e-6


def test_a_body_that_holds_a_pose_rests_and_one_that_waves_does_not():
    held = make_tiny.sway(240)[:1].repeat(240, 1)
    waving = held.clone()
    hand = 3 + 36 * rig.INDEX["leftHand"]
    waving[:, hand:hand + 36].view(240, 12, 3)[..., 1] += 0.3 * torch.sin(torch.arange(240) / 5)[:, None]
    rest = tell.resting(torch.stack([held, waving]), torch.zeros(2, 240, 3))
    assert rest[0].all() and not rest[1].any()


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
