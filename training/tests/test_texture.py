"""What is played of decoded frames, and what the decoder learns of how motion moves."""
import numpy as np
import torch

from visavis_train.motion import features, rig
from visavis_train.train import played, tell, texture


def dance(frames=48, seed=0):
    """A smooth made-up motion on the rig as feature vectors [1, T, F]."""
    rng = np.random.default_rng(seed)
    t = np.arange(frames)[:, None, None] / 30
    turns = 0.4 * np.sin(2 * np.pi * (0.3 + rng.random((1, rig.J, 3))) * t + 6 * rng.random((1, rig.J, 3)))
    rot = rig.local_to_global(rig.rotvec_to_mat(turns))
    hips = np.stack([0.3 * t[:, 0, 0], 0.9 + 0.02 * np.sin(t[:, 0, 0]), 0.2 * t[:, 0, 0]], -1)
    return torch.from_numpy(features.to_features(rig.fk_global(hips, rot), rig.mat_to_quat(rot))).float()[None]


def bones(p):
    return (p[..., 1:, :] - p[..., rig.PARENTS[1:], :]).norm(dim=-1)


def test_motion_on_the_rig_is_played_as_it_is():
    x = dance()
    p, yaw = played.fitted(x)
    assert torch.allclose(p, played.local_positions(x), atol=1e-5) and yaw.abs().max() < 1e-5
    assert torch.allclose(texture.seen(*played.played(x)), tell.seen(x), atol=1e-4)


def test_frames_off_the_rig_are_played_on_its_bones():
    torch.manual_seed(0)
    x = dance()
    off = x + 0.01 * torch.randn_like(x)
    p, _ = played.fitted(off)
    assert (bones(played.local_positions(off)) - played.OFFSETS[1:].norm(dim=-1)).abs().max() > 0.003
    assert torch.allclose(bones(p), played.OFFSETS[1:].norm(dim=-1).expand_as(bones(p)), atol=1e-6)
    hands = [rig.INDEX["leftHand"], rig.INDEX["rightHand"]]
    assert (p - played.local_positions(off))[..., hands, :].norm(dim=-1).mean() < 0.006


def test_the_fit_has_gradients():
    x = dance(8).requires_grad_()
    texture.seen(*played.played(x)).square().mean().backward()
    assert torch.isfinite(x.grad).all() and x.grad.abs().max() > 0


def test_differences_weigh_what_trembles():
    """The same error of pose costs more where it changes from frame to frame, and more in a joint that is steady in recordings."""
    p, _ = played.played(dance(120))
    p = p * torch.linspace(0.1, 1, rig.J)[:, None]
    judge = texture.Differences(p)
    still, trembling = torch.full((120, 1), 0.001), 0.001 * torch.tensor([[1.0], [-1.0]]).repeat(60, 1)
    shifted = lambda joint, by: (lambda q: q.index_add_(2, torch.tensor([joint]), by[None, :, None].expand(1, 120, 1, 3)))(p.clone())
    loss = lambda joint, by: judge.loss(p, shifted(joint, by))
    assert 20 * loss(0, still) < loss(rig.J - 1, trembling) < loss(0, trembling)


def test_a_critic_learns_to_tell_trembling():
    torch.manual_seed(0)
    shown = lambda seed, noise: texture.seen(*(lambda p, yaw: (p + noise * torch.randn_like(p), yaw))(*played.played(dance(40, seed))))
    real, made = torch.cat([shown(s, 0.0) for s in range(6)]), torch.cat([shown(s, 0.004) for s in range(6, 12)])
    critic = texture.Critic(real.mean((0, 1)), real.std((0, 1)), width=8)
    optim = torch.optim.Adam(critic.parameters(), 5e-3)
    for _ in range(60):
        loss = texture.told(critic, real, made, 0.01)
        optim.zero_grad()
        loss.backward()
        optim.step()
    assert critic(shown(20, 0.0)).mean() > critic(shown(20, 0.004)).mean() + 0.5
    made = made.clone().requires_grad_()
    for q in critic.parameters():
        q.grad = None
    texture.frozen(critic, made).mean().backward()
    assert made.grad.abs().max() > 0 and all(q.grad is None for q in critic.parameters())
