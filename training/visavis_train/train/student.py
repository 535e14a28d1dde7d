"""Distils the flow into a network that makes a block in one evaluation (DESIGN 5).

    python -m visavis_train.train.student --cache runs/cache --vae runs/vae.pt --flow runs/flow.pt --out runs/student.pt --minutes 15

The teacher is the multi-step sampler (midpoint 4, guided) started from the same noise, its late evaluations over a clean past; the student sees its
history at `tau_history` and must give the teacher's block at once. Histories are real ones and the student's own closed-loop roll-outs, in which
the user is seen from where the generated body stands. A teacher pass over a window makes a target of every block (`forward_pair`).
"""
import argparse
import os

import numpy as np
import torch

from ..nets.flow import GAZE, Condition, FlowNet
from ..nets.stream import DecoderStream, Stream, branches, combine, history_time, midpoint
from . import common
from .team import Team
from .cache import load_vae
from .flow import noisy, x1_error
from .geometry import integrate, to_local
from .windows import Windows


def pick(c, rows):
    return c.map(lambda t: t[rows])


@torch.no_grad()
def teach(net, history, eps, cond, gaze, guidance, gaze_guidance, steps=4, tau_history=None, clean_from=0.0):
    """What the multi-step sampler makes of each block given its history: [B, T, Dz]. `tau_history`, `clean_from`: see `history_time`."""
    stacked, count = branches(cond, gaze), 3 if gaze else 2

    def evaluate(z, tau, slot):
        past, now = torch.full((1, 1), history_time(tau, tau_history, clean_from)), torch.full((1, 1), tau)
        rows = noisy(history, past, eps)
        with torch.autocast("cpu", torch.bfloat16):
            x1 = net.forward_pair(rows.repeat(count, 1, 1), past, z.repeat(count, 1, 1), now, stacked)
        return combine(x1, count, guidance, gaze_guidance)

    return midpoint(steps, eps, evaluate)


class Rollouts:
    """Closed-loop roll-outs of the student over conditions of the corpus: real latents for `warm` blocks, then its own."""

    def __init__(self, windows, vae, mean, std, warm=16):
        self.windows, self.decoder, self.mean, self.std, self.warm = windows, vae.decoder, mean, std, warm

    @torch.no_grad()
    def make(self, net, size, gaze, tau_history, temperature=1.0):
        """Latents, noise and conditions of `size` windows."""
        w, n, warm = self.windows, self.windows.blocks, self.warm
        picks, cuts, worlds, starts = torch.multinomial(w.weights, size, replacement=True).tolist(), [], [], []
        for i in picks:
            item, phase = w.items[i], int(torch.randint(0, len(w.items[i]["phases"]), (1,)))
            at = int(torch.randint(0, len(item["z"][phase]) - n + 1, (1,)))
            first = item["phases"][phase] + 4 * at
            cuts.append(w.cut(item, phase, at, n))
            worlds.append(item["user"][first:first + 4 * n].double())
            starts.append(item["roots"][first + 4 * warm - 1])
        z, user, agent, voice, g, flags = (torch.stack(c) for c in zip(*cuts))
        cond = Condition(user.flatten(2), agent, voice, g, flags[:, None].repeat(1, n, 1))
        cond = targets(cond, gaze)
        eps, root, worlds = temperature * torch.randn_like(z), torch.stack(starts), torch.stack(worlds)
        stream = Stream(net, size, gaze=gaze, tau_history=tau_history, single=True)
        at = lambda c, k: c.map(lambda t: t[:, k:k + 1])
        stream.warm(z[:, :warm], eps[:, :warm], cond.map(lambda t: t[:, :warm]))
        decoder, place = DecoderStream(self.decoder, size), lambda z: z * w.std + w.mean
        for k in range(warm):
            decoder.step(place(z[:, k:k + 1]))
        for k in range(warm, n):
            cond.user[:, k] = to_local(root, worlds[:, 4 * k - 4:4 * k][..., [0, 2]]).float().flatten(1)
            new = stream.step(eps[:, k:k + 1], at(cond, k))
            z[:, k] = new[:, 0]
            x = decoder.step(place(new)) * self.std + self.mean
            root = integrate(x[..., :3].double(), root)[:, -1]
        return z, eps, cond


def targets(cond, gaze):
    """Sets a constant gaze target per sequence, or clears the channel."""
    if not gaze:
        return cond.dropped(GAZE)
    b = len(cond.gaze)
    wish = torch.where(torch.rand(b, 1, 1) < 0.3, torch.randint(0, 2, (b, 1, 1)).float(), torch.rand(b, 1, 1) * 1.1 - 0.1)
    flags = cond.flags.clone()
    flags[..., GAZE] = 1
    return Condition(cond.user, cond.agent, cond.voice, wish.expand_as(cond.gaze).clone(), flags)


def beginning(flow, init=None, change=None):
    """Weights to start from: the flow's, those of the checkpoint `init`, or the flow's with the `change` from one checkpoint to another."""
    ema = lambda path: torch.load(path, weights_only=False)["ema"]
    if init:
        return ema(init)
    if not change:
        return flow
    before, after = map(ema, change)
    return {k: v + after[k] - before[k] for k, v in flow.items()}


def calibrated(cond, pairs):
    """The condition with its gaze targets replaced by what the teacher must be asked for to give them: `pairs` are (target, asked)."""
    if not pairs:
        return cond
    asked = np.interp(cond.gaze.numpy(), *zip(*pairs))
    return Condition(cond.user, cond.agent, cond.voice, torch.from_numpy(asked).float(), cond.flags)


def pairs(text):
    """"0:-0.1,0.5:0.45,1:1" -> ascending (target, asked) pairs."""
    return sorted(tuple(float(v) for v in pair.split(":")) for pair in text.split(","))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    for name in ("cache", "vae", "flow", "out"):
        parser.add_argument(f"--{name}", required=True)
    parser.add_argument("--minutes", type=float, default=15)
    parser.add_argument("--blocks", type=int, default=64)
    parser.add_argument("--batch", type=int, default=16)
    parser.add_argument("--teach", type=int, default=8, help="sequences of a teacher pass")
    parser.add_argument("--reuse", type=int, default=4, help="student updates for each teacher pass")
    parser.add_argument("--own", type=float, default=0.5, help="share of teacher passes over the student's own roll-outs")
    parser.add_argument("--tau-history", type=float, default=0.9)
    parser.add_argument("--guidance", type=float, default=1.5)
    parser.add_argument("--gaze-guidance", type=float, default=2.0)
    parser.add_argument("--gaze-map", type=pairs, metavar="TARGET:ASKED,...", help="what the teacher is asked for where the student is asked for a "
                        "target (linear between), so that the student gives it: from roll-outs of the teacher")
    parser.add_argument("--clean-from", type=float, default=0.3,
                        help="the teacher imputes history below this flow time and sees it at --tau-history from there; above 1: always imputed")
    parser.add_argument("--temperature", type=float, default=0.75, help="scale of the noise, as sessions use it")
    parser.add_argument("--lr", type=float, default=4e-4)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--init", help="student checkpoint to start from; without it the flow")
    parser.add_argument("--init-change", nargs=2, metavar=("FLOW", "STUDENT"),
                        help="start from --flow changed as this earlier flow was on the way to its student: much nearer than the flow itself")
    parser.add_argument("--workers", type=int, default=1, help="processes, each with teacher passes of its own")
    parser.add_argument("--resume", action="store_true")
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    torch.manual_seed(3)
    team = Team(args.workers)
    windows = Windows(os.path.join(args.cache, "train.pt"), args.blocks, 0.03, 0.02, 0, 0.05)
    vae, mean, std, _ = load_vae(args.vae)
    base = torch.load(args.flow, weights_only=False)
    teacher, net = (FlowNet(base["latent"], base["audio"], **base["size"]) for _ in range(2))
    teacher.load_state_dict(base["ema"])
    teacher.eval().requires_grad_(False)
    net.load_state_dict(beginning(base["ema"], args.init, args.init_change))
    metric, kept = base["metric"], {k: base[k] for k in ("size", "latent", "audio", "latent_mean", "latent_std", "metric")}
    loop = common.Loop(team, net, args.out, args.minutes, args.lr, warmup=50, resume=args.resume, tau_history=args.tau_history, guidance=args.guidance,
                       gaze_guidance=args.gaze_guidance, **kept)
    rollouts = Rollouts(windows, vae, mean, std)
    which = torch.Generator().manual_seed(loop.step)  # the same kind of pass in all processes: none waits for the dearer one
    team.seed(4 + loop.step)
    store = []
    while loop.progress < 1:
        gaze = bool(torch.rand(1) < 0.6)
        own = bool(torch.rand(1, generator=which) < args.own * min(1.0, loop.step / 200))
        if own:
            history, eps, cond = rollouts.make(loop.ema.net, args.teach, gaze, args.tau_history, args.temperature)
        else:
            history, cond = windows.batch(args.teach)
            cond, eps = targets(cond, gaze), args.temperature * torch.randn_like(history)
        wish = teach(teacher, history, eps, calibrated(cond, args.gaze_map) if gaze else cond, gaze, args.guidance, args.gaze_guidance,
                     tau_history=args.tau_history, clean_from=args.clean_from)
        for row in range(args.teach):
            store.append((history[row], eps[row], wish[row], pick(cond, row), own))
        store = store[-800:]
        for _ in range(args.reuse):
            fresh = list(range(max(0, len(store) - args.teach), len(store)))
            rows = (fresh + torch.randint(0, len(store), (args.batch,)).tolist())[:args.batch]
            h, e, w = (torch.stack([store[i][k] for i in rows]) for k in range(3))
            c = Condition(*(torch.stack([getattr(store[i][3], n) for i in rows]) for n in ("user", "agent", "voice", "gaze", "flags")))
            tau = torch.full((1, 1), args.tau_history)
            with torch.autocast("cpu", torch.bfloat16):
                x1 = net.forward_pair(noisy(h, tau, e), tau, e, torch.zeros(1, 1), c)
            error = x1_error(x1, w, metric)[:, 4:].mean(1)
            own = [v for v, i in zip(error.tolist(), rows) if store[i][4]]
            loop.update(error.mean(), loss=error.mean(), **({"own": sum(own) / len(own)} if own else {}))
            loop.report(100)
    loop.finish()


if __name__ == "__main__":
    main()
