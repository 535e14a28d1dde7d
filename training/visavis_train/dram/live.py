"""Goes on with a checkpoint in the network's own motion: agents that live on for minutes are held to how the corpus moves, not to its very poses.

    python -m visavis_train.dram.live --data WORK/dram --init runs/dram-tcn.pt --out runs/dram-live.pt --minutes 40

A squared error of poses makes the mean of what may come, which hardly moves. Here, beside that error over recorded poses, stretches of `--frames`
frames of `agents.Agents` have losses of `alike.py`: distributions of speeds and of poses, a critic that hears the agent's voice, the gaze score
towards a wanted one, the place towards the recorded agent's, feet that stand. Gradients end at the stretch's beginning.
"""
import argparse

import torch
import torch.nn.functional as F
from torch.func import functional_call

from ..train import common
from ..train.common import mixed
from ..train.geometry import turn
from ..train.loop import Loop
from ..train.team import Team
from . import alike, evaluate, measure, nets, pose, roll, train
from .agents import PAST, Agents
from .data import Split

WEIGHTS = {"near": 1.0, "speeds": 1.0, "poses": 1.0, "gaze": 10.0, "place": 2.0, "feet": 2.0, "critic": 0.5}


def placed(roots, there):
    """Distance to where the recorded agent stands, in units of 0.4 m, and to its heading, of 0.5 rad: as Huber's."""
    d = (roots - there).float()
    off = torch.cat([d[..., :2] / 0.4, torch.stack(turn(d[..., 2], torch.zeros_like(d[..., 2]), torch.ones_like(d[..., 2])), -1) / 0.5 - torch.tensor([0, 2.0])], -1)
    return F.smooth_l1_loss(off, torch.zeros_like(off))


class Live:
    """The losses of a step; no `critic`, none of its."""

    def __init__(self, net, critic, agents, data):
        self.net, self.critic, self.agents, self.data = net, critic, agents, data
        w = data.sample(256, 2)
        p = pose.kinematics(w.y[:, 1, pose.LEAD:].unflatten(-1, (-1, 6)), w.y[:, 1, 3])[0]
        self.std = (p - p[:, :1] * torch.tensor([1.0, 0.0, 1.0])).std(0).clamp(min=0.02)

    def __call__(self, step, batch):
        parts = {}
        if step % 2 == 0:
            window = self.data.sample(batch, train.FIRST + 1)
            with mixed("cpu"):
                parts["near"] = 2 * train.losses(self.net, window, pose.Layout(), 0)[0]
        y, roots, w = self.agents.stretch(self.net)
        made = alike.Body(y, roots, w.head)
        with torch.no_grad():
            real = alike.Body(w.y, w.roots)
        seen = w.flags[:, [2, 4]]
        gaze, slow = alike.own_scores(made.score[:, PAST:], self.agents.score, w.wanted, seen, self.agents.chosen, w.gaze[:, PAST:])
        self.agents.score = slow
        parts |= {"gaze": gaze, "speeds": alike.alike(made, real, alike.doing(w)), "poses": alike.poses(made, real, self.std),
                  "place": placed(roots[:, PAST:], w.roots[:, PAST:]), "feet": alike.feet(made)}
        if self.critic is None:
            return parts, 0.0
        voice = nets.voice(w.agent.float(), w.flags[:, None, :1].expand(-1, y.shape[1], -1))
        truth, own = self.critic.see(real, voice), self.critic.see(made, voice)
        fixed = {k: v.detach() for k, v in self.critic.named_parameters()}
        parts["critic"] = -functional_call(self.critic, fixed, own).mean()
        truth[0].requires_grad_()
        score = self.critic(*truth)
        told = (1 + self.critic(*(x.detach() for x in own))).clamp(min=0).mean() + (1 - score).clamp(min=0).mean()
        if step % 4 == 0:
            told = told + 4 * 0.02 * torch.autograd.grad(score.sum(), truth[0], create_graph=True)[0].square().sum((1, 2)).mean()
        return parts, told


@torch.no_grad()
def judged(net, data, frames=240, windows=16):
    """Free-running figures on held-out clips."""
    out = {}
    for gaze in (None, 0.0, 0.9):
        row, _ = evaluate.running(net, pose.Layout(), data, windows, frames, gaze)
        out |= {f"{k} {gaze}": row[k] for k in ("gaze",)}
        if gaze is None:
            out |= {k: row[k] for k in ("stillness", "hand m/s", "wrist talking", "wrist not", "foot slide", "root m/s", "distance m", "floor mm")}
    e, _ = measure.position_errors(net, pose.Layout(), data, 24)
    return out | {"ape": e.mean().item()}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", required=True, help="folder of visavis_train.dram.data")
    parser.add_argument("--init", required=True, help="checkpoint of visavis_train.dram.train, whole body")
    parser.add_argument("--out", required=True)
    parser.add_argument("--agents", type=int, default=64, help="agents that live on [64]")
    parser.add_argument("--frames", type=int, default=32, help="of a stretch [32]")
    parser.add_argument("--weights", default="", help="NAME:W,... instead of " + ",".join(f"{k}:{v}" for k, v in WEIGHTS.items()))
    common.arguments(parser, steps=3000, lr=5e-4, batch=16)
    args = parser.parse_args()
    common.start_process(args)
    weights = WEIGHTS | {k: float(v) for k, v in (x.split(":") for x in args.weights.split(",") if x)}
    data, held = Split(args.data, "train"), Split(args.data, "val")
    net, layout, start = train.load(args.init)
    if layout != pose.Layout() or start["variant"] != "dram":
        raise SystemExit(f"{args.init} is {start['variant']} of layout {start['layout']}; agents need dram of the whole body")
    net.train()
    agents, critic = Agents(net, data, args.agents, args.frames), alike.Critic(start["features"] + 1) if weights["critic"] else None
    live = Live(net, critic, agents, data)
    loop = Loop(Team(1), net, args, warmup=50, average=0.998, beside={"critic": critic} if critic else {}, memory=agents,
                **{k: start[k] for k in ("backbone", "sizes", "variant", "layout", "features")})
    for step in loop:
        parts, told = live(step, args.batch)
        loop.update(sum(weights[k] * v for k, v in parts.items()) + told, told=told, **parts)
        loop.report(25, lambda net: judged(net, held), 500)
    loop.finish(lambda net: judged(net, held))


if __name__ == "__main__":
    main()
