"""What moves a student towards a distribution, and that it does not move its critics."""
import torch

from visavis_train import make_tiny
from visavis_train.nets.flow import Condition, FlowNet
from visavis_train.train import matching


def net():
    return make_tiny.lively(FlowNet(8, 6, layers=1, width=32, heads=4, mlp=2, tau_width=16, window_blocks=5, embed_latent=16, embed_user=8,
                                    embed_voice=12, embed_gaze=4))


def test_blocks_like_the_teachers_are_not_moved_and_others_are():
    torch.manual_seed(0)
    teacher, other, b, t = net(), net(), 2, 6
    x1 = torch.randn(b, t, 8, requires_grad=True)
    history, eps, tau = torch.randn(b, t, 8), torch.randn(b, t, 8), torch.full((1, 1), 0.9)
    cond = Condition(torch.randn(b, t, 8), torch.randn(b, t, 24), torch.randn(b, t, 24), torch.rand(b, t, 4), torch.ones(b, t, 4))
    for critic, moves in ((teacher, False), (other, True)):
        move, told = matching.Critic(critic, teacher).losses(history, tau, eps, x1, cond, torch.eye(8))
        x1.grad = None
        move.backward()
        assert (x1.grad.abs().max() > 1e-4) == moves
        told.backward()
        assert critic.input.weight.grad.abs().max() > 0 and (teacher is critic or teacher.input.weight.grad is None)
        teacher.zero_grad(set_to_none=True)


def test_the_judge_learns_to_tell_and_the_student_gets_its_direction():
    torch.manual_seed(0)
    judge = matching.Judge(16)
    calm = make_tiny.sway(64)[None].repeat(4, 1, 1)
    adversary = matching.Adversary(judge, lambda z: calm + z.mean(-1, keepdim=True).repeat_interleave(4, 1) * 0.05)
    optim, seen = torch.optim.Adam(judge.parameters(), 1e-2), []
    for _ in range(40):
        made = 3 * torch.randn(4, 16, 8)
        told = adversary.losses(made, torch.zeros(4, 16, 8))[1]
        optim.zero_grad()
        told.backward()
        optim.step()
        seen.append(told.item())
    assert seen[-1] < 0.5 * seen[0]
    optim.zero_grad(set_to_none=True)
    made = (3 * torch.randn(4, 16, 8)).requires_grad_()
    adversary.losses(made, torch.zeros(4, 16, 8))[0].backward()
    assert made.grad.abs().max() > 0 and all(p.grad is None for p in judge.parameters())
