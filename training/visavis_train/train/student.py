"""Distils the flow into a network that makes a block in one evaluation (DESIGN 5).

    python -m visavis_train.train.student --cache runs/cache --vae runs/vae.pt --flow runs/flow.pt --out runs/student.pt --steps 3000

The teacher is the multi-step sampler (midpoint 4, guided) started from the same noise, its late evaluations over a clean past; the student sees its
history at `tau_history` and must give the teacher's block at once. Histories are real ones and the student's own closed-loop roll-outs, in which
the user is seen from where the generated body stands. A teacher pass over a window makes a target of every block (`forward_pair`).
"""
import argparse
import os
from dataclasses import replace

import numpy as np
import torch

from ..nets.flow import GAZE, USER, Condition
from ..nets.stream import DecoderStream, Stream, branches, combine, history_time, midpoint, reacting
from . import common
from .cache import load_vae
from .common import mixed
from .flow import described, latent_metric, load_flow, noisy, x1_error
from .geometry import integrate, to_local
from .loop import Loop
from .matching import Adversary, Critic, Judge
from .team import Team
from .windows import Windows

REST = 0.1  # a latent that changes by less from block to block [deviations] is a body at rest: of the corpus' still blocks 0.08


@torch.no_grad()
def teach(net, history, eps, cond, gaze, guidance, gaze_guidance, steps=4, tau_history=None, clean_from=0.0):
    """What the multi-step sampler makes of each block given its history: [B, T, Dz]. `guidance`: one weight, or one a token [B, T, 1]; `tau_history`,
    `clean_from`: see `history_time`."""
    stacked, count = branches(cond, gaze), 3 if gaze else 2

    def evaluate(z, tau, slot):
        past, now = (torch.full((1, 1), t, device=eps.device) for t in (history_time(tau, tau_history, clean_from), tau))
        rows = noisy(history, past, eps)
        with mixed(eps.device):
            x1 = net.forward_pair(rows.repeat(count, 1, 1), past, z.repeat(count, 1, 1), now, stacked)
        return combine(x1, count, guidance, gaze_guidance)

    return midpoint(steps, eps, evaluate)


class Rollouts:
    """Closed-loop roll-outs of the student over conditions of the corpus: real latents for `warm` blocks, then its own."""

    def __init__(self, windows, vae, mean, std, warm=16):
        self.windows, self.decoder, self.mean, self.std, self.warm = windows, vae.decoder, mean, std, warm

    @torch.no_grad()
    def make(self, net, size, gaze, tau_history, temperature=1.0):
        """Places, latents, noise and conditions of `size` windows."""
        w, n, warm = self.windows, self.windows.blocks, self.warm
        mean, std = w.mean.to(w.device), w.std.to(w.device)
        place = w.draw(size)
        z, cond = w.read(*place)
        cond, frames = targets(cond, gaze), w.frames(*place)
        cond.flags[..., USER:USER + 1] *= w.seen(size)
        eps, root = temperature * torch.randn_like(z), w.roots[frames[:, 4 * warm + 3]]
        stream = Stream(net, size, gaze=gaze, tau_history=tau_history, single=True)
        stream.warm(z[:, :warm], eps[:, :warm], cond.at(slice(warm)))
        decoder, placed = DecoderStream(self.decoder), lambda z: z * std + mean
        for k in range(warm):
            decoder.step(placed(z[:, k:k + 1]))
        for k in range(warm, n):
            now = slice(k, k + 1)
            user = w.user[frames[:, 4 * k:4 * k + 4]]  # block k - 1's: `frames` begin with the block before the window
            cond.user[:, k] = to_local(root, user[..., [0, 2]].double()).float().flatten(1)
            if w.sound_features:
                cond.sound[:, k] = w.room(place[0], frames[:, 4 * k:4 * k + 4], root[:, None])[0][:, 0]
            new = stream.step(eps[:, now], cond.at(now))
            z[:, k] = new[:, 0]
            x = decoder.step(placed(new)) * self.std + self.mean
            root = integrate(x[..., :3].double(), root)[:, -1]
        return place, z, eps, cond


class Memory:
    """The last `size` sequences with their teacher's blocks. Voices' features are not kept but read again at their places."""

    def __init__(self, windows, size):
        self.windows, self.size, self.count, self.kept = windows, size, 0, {}

    def add(self, place, history, eps, wish, cond, own):
        rows = {"segment": place[0], "at": place[1], "history": history, "eps": eps, "wish": wish, "user": cond.user, "gaze": cond.gaze,
                "flags": cond.flags, "own": torch.full((len(eps),), own)} | ({} if cond.sound is None else {"sound": cond.sound, "heard": cond.heard})
        slots = torch.arange(self.count, self.count + len(eps)) % self.size
        for name, value in rows.items():
            if name not in self.kept:
                self.kept[name] = torch.zeros((self.size, *value.shape[1:]), dtype=value.dtype, device=value.device)
            self.kept[name][slots.to(value.device)] = value
        self.count += len(eps)

    def pick(self, fresh, batch):
        """The `fresh` newest sequences, and random ones to make up `batch`: history, eps, wish, condition, own, places."""
        newest = torch.arange(self.count - fresh, self.count) % self.size
        rows = torch.cat([newest, torch.randint(0, min(self.count, self.size), (batch,))])[:batch]
        at = lambda name: self.kept[name][rows.to(self.kept[name].device)]
        where = at("segment"), at("at")
        heard = self.windows.read(*where)[1]
        room = (at("sound"), at("heard")) if "sound" in self.kept else ()
        return at("history"), at("eps"), at("wish"), Condition(at("user"), heard.agent, heard.voice, at("gaze"), at("flags"), *room), at("own"), where

    def state_dict(self):
        return {"count": self.count, "kept": self.kept}

    def load_state_dict(self, state):
        self.count, self.kept = state["count"], {k: v.to("cpu" if k in ("segment", "at", "own") else self.windows.device) for k, v in state["kept"].items()}


def targets(cond, gaze):
    """Sets a constant gaze target per sequence, or clears the channel."""
    if not gaze:
        return cond.dropped(GAZE)
    b = len(cond.gaze)
    wish = torch.where(torch.rand(b, 1, 1) < 0.3, torch.randint(0, 2, (b, 1, 1)).float(), torch.rand(b, 1, 1) * 1.1 - 0.1).to(cond.gaze.device)
    flags = cond.flags.clone()
    flags[..., GAZE] = 1
    return replace(cond, gaze=wish.expand_as(cond.gaze).clone(), flags=flags)


def beginning(flow, init=None, change=None):
    """Weights to start from: the flow's, those of the checkpoint `init`, or the flow's with the `change` from one checkpoint to another (none where
    that one has no such weights)."""
    ema = lambda path: common.load(path)["ema"]
    if init:
        return ema(init)
    if not change:
        return flow
    before, after = map(ema, change)
    return {k: v + after[k] - before[k] if k in before else v for k, v in flow.items()}


def calibrated(cond, pairs):
    """The condition with its gaze targets replaced by what the teacher must be asked for to give them: `pairs` are (target, asked)."""
    if not pairs:
        return cond
    asked = np.interp(cond.gaze.cpu().numpy(), *zip(*pairs))
    return replace(cond, gaze=torch.from_numpy(asked).float().to(cond.gaze.device))


def rest_weight(wish, history, still):
    """Weight of each block's error [B, T - 1], from the second on, 1 on average: a block that the teacher leaves where it was weighs up to 1 + `still`."""
    moved = (wish[:, 1:] - history[:, :-1]).square().mean(-1)
    weight = 1 + still / (1 + moved / REST ** 2)
    return weight / weight.mean()


def pairs(text):
    """"0:-0.1,0.5:0.45,1:1" -> ascending (target, asked) pairs."""
    return sorted(tuple(float(v) for v in pair.split(":")) for pair in text.split(","))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    for name in ("cache", "vae", "flow", "out"):
        parser.add_argument(f"--{name}", required=True)
    parser.add_argument("--blocks", type=int, default=64)
    parser.add_argument("--teach", type=int, default=8, help="sequences of a teacher pass")
    parser.add_argument("--reuse", type=int, default=4, help="student updates for each teacher pass")
    parser.add_argument("--own", type=float, default=0.5, help="share of teacher passes over the student's own roll-outs")
    parser.add_argument("--tau-history", type=float, default=0.9)
    parser.add_argument("--guidance", type=float, default=1.5)
    parser.add_argument("--gaze-guidance", type=float, default=2.0)
    parser.add_argument("--reaction-guidance", type=float, default=1.0, help="how many times as far the teacher is guided while a sound is reacted to [1]")
    parser.add_argument("--gaze-map", type=pairs, metavar="TARGET:ASKED,...", help="what the teacher is asked for where the student is asked for a "
                        "target (linear between), so that the student gives it: from roll-outs of the teacher")
    parser.add_argument("--clean-from", type=float, default=0.3,
                        help="the teacher imputes history below this flow time and sees it at --tau-history from there; above 1: always imputed")
    parser.add_argument("--temperature", type=float, default=0.75, help="scale of the noise, as sessions use it")
    parser.add_argument("--init", help="student checkpoint to start from; without it the flow")
    parser.add_argument("--init-change", nargs=2, metavar=("FLOW", "STUDENT"),
                        help="start from --flow changed as this earlier flow was on the way to its student: much nearer than the flow itself")
    parser.add_argument("--still", type=float, default=0.0, help="blocks that the teacher leaves at rest weigh up to 1 + STILL [0]")
    parser.add_argument("--matching", type=float, default=0.0, help="weight of distribution matching (train/matching.py) [0]")
    parser.add_argument("--adversarial", type=float, default=0.0, help="weight of the adversarial loss on decoded motion [0]")
    parser.add_argument("--sounds", type=float, default=1.0, help="how much more often windows with sounds are drawn than their length says [1]")
    parser.add_argument("--away", type=float, default=0.1, help="share of windows and roll-outs in which the user is not seen [0.1]")
    parser.add_argument("--quiet", type=float, default=0.5, help="share of windows in which a voice that a clip lacks is heard to be silent: sessions have both [0.5]")
    parser.add_argument("--memory", type=int, default=800, help="sequences that updates draw on")
    common.arguments(parser, steps=3000, lr=4e-4, batch=16)
    args = parser.parse_args()
    device, team = common.start_process(args), Team(args.workers)
    windows = Windows(os.path.join(args.cache, "train.pt"), args.blocks, 0.03, 0.02, 0, 0.05, device=device, sounds=args.sounds, away=args.away, quiet=args.quiet)
    vae, mean, std, _ = load_vae(args.vae, device)
    vae.requires_grad_(False)
    (teacher, base), (net, _) = load_flow(args.flow, device), load_flow(args.flow, device)
    teacher.requires_grad_(False)
    net.load_state_dict(beginning(base["ema"], args.init, args.init_change))
    if not torch.allclose(base["latent_mean"], windows.mean, atol=1e-4):
        raise SystemExit(f"{args.cache} standardises latents otherwise than {args.flow}: make it with --standard {args.flow}")
    if "metric" not in base:  # a bundle's
        base["metric"] = latent_metric(vae, mean, std, windows.batch(24)[0][:, :16], windows.mean.to(device), windows.std.to(device)).cpu()
    metric, kept = base["metric"].to(device), described(base)
    memory = Memory(windows, args.memory)
    decode = lambda z: vae.decoder(z * windows.std.to(device) + windows.mean.to(device)) * std + mean
    critic = Critic(load_flow(args.flow, device)[0].train(), teacher) if args.matching else None
    adversary = Adversary(Judge().to(device), decode) if args.adversarial else None
    beside = ({"critic": critic.net} if critic else {}) | ({"judge": adversary.judge} if adversary else {})
    loop = Loop(team, net.train(), args, warmup=50, beside=beside, memory=memory, tau_history=args.tau_history, guidance=args.guidance,
                gaze_guidance=args.gaze_guidance, temperature=args.temperature, **kept)
    rollouts, tau = Rollouts(windows, vae, mean, std), torch.full((1, 1), args.tau_history, device=device)
    for step in loop:
        if step % args.reuse == 0 or not memory.count:
            gaze = bool(torch.rand(1) < 0.6)
            own = team.draw(args.seed, step) < args.own * min(1.0, step / 200)  # the same kind of pass in all processes: none waits for the dearer one
            if own:
                place, history, eps, cond = rollouts.make(loop.ema.net, args.teach, gaze, args.tau_history, args.temperature)
            else:
                place = windows.draw(args.teach)
                history, cond = windows.batch(args.teach, place)
                cond, eps = targets(cond, gaze), args.temperature * torch.randn_like(history)
            guidance = reacting(args.guidance, windows.called(cond), args.reaction_guidance)
            wish = teach(teacher, history, eps, calibrated(cond, args.gaze_map) if gaze else cond, gaze, guidance, args.gaze_guidance,
                         tau_history=args.tau_history, clean_from=args.clean_from)
            memory.add(place, history, eps, wish, cond, own)
        history, eps, wish, cond, own, where = memory.pick(args.teach, args.batch)
        with mixed(device):
            x1 = net.forward_pair(noisy(history, tau, eps), tau, eps, torch.zeros(1, 1, device=device), cond)
        error = (x1_error(x1, wish, metric)[:, 4:] * rest_weight(wish, history, args.still)[:, 3:]).mean(1)
        loss, parts = error.mean(), {"loss": error.mean()} | ({"own": error[own.to(device)].mean()} if own.any() else {})
        if critic:
            move, told = critic.losses(history, tau, eps, x1, cond, metric)
            loss, parts = loss + args.matching * move + told, parts | {"matching": move, "critic": told}
        if adversary:
            move, told = adversary.losses(x1, windows.read(*where)[0])
            loss, parts = loss + args.adversarial * move + told, parts | {"adversarial": move, "judge": told}
        loop.update(loss, **parts)
        loop.report(100)
    loop.finish()


if __name__ == "__main__":
    main()
