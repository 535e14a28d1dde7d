"""How active a body at rest is, as a condition: what it is in a corpus, and the training of a network's way in for it, all else held.

    python -m visavis_train.train.activity --corpus DIR --measure
    python -m visavis_train.train.activity --corpus DIR --cache runs/cache --vae runs/vae.pt --flow runs/flow.pt --out runs/flow-activity.pt
    python -m visavis_train.train.activity --flow runs/flow-activity.pt --data DATA --into B.safetensors --out C.safetensors

Seen from block to block people at rest are of two kinds, and change from one to the other every ten seconds or so: they stand like a post, or they
look for something to do with their hands. A flow that does not know which it is about to be plays their mean and stays in it; told, it follows.
A token is told three numbers of the stretch of some seconds in which it lies (`levels`), where the body is at rest (`at_rest`): what sessions can tell, too.
"""
import argparse
import json
import os

import numpy as np
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from .. import bundle as bundles
from ..corpus import measures, rest, store
from ..motion import rig
from ..nets.flow import ACTIVITY, FlowNet
from . import common
from .cache import load_vae
from .data import Split
from .flow import apart_loss, described, latent_metric, load_flow, noisy, shared_loss, x1_error
from .geometry import to_world
from .loop import Loop
from .team import Team
from .windows import LOOSE, Windows

LOUD = 0.03       # peak of a voice that speaks
QUIET = 32        # frames since the agent last spoke, from which on it is at rest
STANDS = 0.25     # metres that a user who stands moves by in as many frames, at most
HIDDEN = 64
STRETCH = 10.0    # seconds of a stretch of people
SHORT, LONG = 180, 420  # frames of a stretch


def at_rest(voice, user, frames):
    """[T] bool: the agent (`voice` [800 T] i16, or None) has not spoken for a second and the user's head [T, 3] stands. Causal, by blocks: what a session
    knows when it makes the block."""
    quiet, blocks = np.ones(frames, bool), np.arange(frames) // 4
    if voice is not None:
        loud = np.abs(voice[:rig.SAMPLES_PER_FRAME * frames].astype(np.float32)).reshape(frames, -1).max(1) > LOUD * 32767
        last = np.maximum.accumulate(np.where(loud, np.arange(frames), -QUIET - 4))
        quiet = np.minimum(4 * blocks + 3, frames - 1) - last[np.minimum(4 * blocks + 3, frames - 1)] >= QUIET
    seen, floor = 4 * blocks - 1, user[:frames][:, [0, 2]]
    moved = np.linalg.norm(floor[np.maximum(seen, 0)] - floor[np.maximum(seen - QUIET, 0)], axis=1)
    return quiet & ((moved < STANDS) | (seen < QUIET))


def sums(positions, rotations, resting):
    """[T + 1, 4] running sums over the frames at rest: frames that are not still, hand and head speed m/s, frames."""
    t = measures.tracks(positions, rotations)
    rows = np.stack([~(t["hand_v"] < measures.STILL).all(1), t["hand_v"].mean(1), t["head_v"], np.ones(len(positions))], 1) * resting[:, None]
    return np.concatenate([np.zeros((1, 4)), rows.cumsum(0)])


def levels(total):
    """Sums over stretches [..., 4] -> activity [..., ACTIVITY] near -1 .. 1: share of frames that are not still, speed of the hands, of the head."""
    count = total[..., 3:].clamp(min=1)
    stir, hand, head = (total[..., :3] / count).unbind(-1)
    return torch.stack([2 * stir - 1, (hand.clamp(min=0.002) / 0.04).log2() / 3, (head.clamp(min=0.001) / 0.015).log2() / 2], -1).float()


def kept(folder, split):
    """Running sums of a split that have been measured."""
    return common.load(os.path.join(folder, split + ".activity.pt"))["sums"]


def measure(folder, split):
    """Running sums [N + 1 a clip, 4] of all clips of a split, one behind the other."""
    clips, out = Split(folder, split), []
    for path, name, a, b in zip(clips.paths, clips.names, clips.starts[:-1].tolist(), clips.starts[1:].tolist()):
        roots, clip = clips.roots[a:b], store.load(path)
        p = to_world(roots, clips.frames[a:b, 3:3 + 3 * rig.J].unflatten(1, (-1, 3)).double()).numpy()
        resting = at_rest(clip.agent_voice, clip.user_head, b - a) & (not name.startswith(LOOSE))
        out.append(sums(p, rig.axis_mat("y", roots[:, 2].numpy())[:, None], resting))
    return torch.from_numpy(np.concatenate(out)).float()


class Told(Windows):
    """Windows whose tokens are told of the activity of their stretches."""

    def __init__(self, cache, sums, blocks, keep=0.8, **kw):
        super().__init__(cache, blocks, **kw)
        self.sums, self.keep = sums, keep

    def read(self, segment, at):
        z, cond = super().read(segment, at)
        clip, frames = segment[:, 0], self.frames(segment, at)[:, 4:].cpu()
        first, last = self.starts[clip][:, None], self.starts[clip + 1][:, None]
        length = torch.randint(SHORT, LONG, (len(at), 1))
        start = frames[:, ::4] - (frames[:, ::4] - first + (torch.rand(len(at), 1) * length).long()) % length
        a, b = start.clamp(min=0).maximum(first), (start + length).minimum(last)
        total = self.sums[b + clip[:, None]] - self.sums[a + clip[:, None]]
        now = self.sums[frames[:, ::4] + 1 + clip[:, None]] - self.sums[frames[:, ::4] + clip[:, None]]
        resting = (now[..., 3] > 0) & (total[..., 3] >= 60)
        cond.activity, cond.resting = levels(total), resting[..., None].float()
        return z, cond

    def batch(self, size, place=None):
        z, cond = super().batch(size, place)
        cond.resting = cond.resting * (torch.rand(size, 1, 1) < self.keep)
        return z, cond


def told(net, state):
    """The network of a checkpoint with a way in for activity, that alone to be trained."""
    new = FlowNet(state["latent"], state["audio"], **state["size"], sound_features=state.get("sound", 0), embed_activity=HIDDEN)
    new.load_state_dict(net.state_dict(), strict=False)
    return only(new)


def only(net):
    """The network, its way in for activity alone to be trained."""
    for name, p in net.named_parameters():
        p.requires_grad_("embed_activity" in name)
    return net


@torch.no_grad()
def validate(net, held, metric):
    """Error at flow times with the activity told and not, of the tokens at rest."""
    torch.manual_seed(1)
    z, cond = held.batch(32)
    at, out = cond.resting[:, 8:, 0] > 0, {}
    for name, tau in (("0", 0.0), ("3", 0.375), ("6", 0.75)):
        t, rows = torch.full((len(z), 1), tau), noisy(z, torch.full((len(z), 1), tau), torch.randn_like(z))
        for kind, c in (("told", cond), ("free", cond.map(lambda x: x))):
            if kind == "free":
                c.resting = torch.zeros_like(c.resting)
            out[kind + name] = x1_error(net(rows, t, c), z, metric)[:, 8:][at].mean().item()
    return out


def people(data, seconds=STRETCH, count=192, seed=0):
    """Activity of stretches of real people who do not act [count, ACTIVITY], each of them as often as the others."""
    every, weights = [], []
    for name in rest.REAL_ROW:
        take = rest.take(data, name)
        total = torch.from_numpy(sums(take.positions, take.rotations, np.ones(len(take.positions), bool))).float()
        frames = round(seconds * rig.FPS)
        starts = torch.arange(0, max(1, len(take.positions) - frames), frames // 4)
        every.append(levels(total[(starts + frames).clamp(max=len(total) - 1)] - total[starts]))
        weights.append(torch.full((len(starts),), 1 / len(starts)))
    # Evenly spaced quantiles along the list, which is sorted by stirring: no chance in which are drawn.
    every, weights = torch.cat(every), torch.cat(weights)
    order = every[:, 0].argsort()
    share = weights[order].cumsum(0) / weights.sum()
    return every[order[torch.searchsorted(share, (torch.arange(count) + 0.5) / count)]]


def graft(source, flow, table, out):
    """Writes a bundle with the way in of a flow's checkpoint for both its networks, and what a body at rest draws from. Both take the same: a student
    begins as its flow, and its tokens mean the same. Other tensors keep their bytes, quantised or not."""
    with safe_open(source, framework="pt") as f:
        config, tensors = json.loads(f.metadata()[bundles.KEY]), {k: f.get_tensor(k) for k in f.keys()}
    way = {k: v.half() for k, v in flow.items() if k.startswith("embed_activity.")}
    for net in ("flow", "student") if config.get("student") else ("flow",):
        tensors |= {f"{net}.{k}": v.clone() for k, v in way.items()}
    config["rest"] = {"embed": HIDDEN, "levels": [[round(v, 4) for v in row] for row in table.tolist()], "seconds": STRETCH}
    save_file(tensors, out, metadata={bundles.KEY: json.dumps(config)})


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--measure", action="store_true", help="measure the corpus, which training needs")
    parser.add_argument("--into", metavar="BUNDLE", help="write this bundle with the way in of --flow, and the stretches of the people of --data")
    for name in ("corpus", "data", "cache", "vae", "flow", "out"):
        parser.add_argument(f"--{name}")
    parser.add_argument("--blocks", type=int, default=64)
    parser.add_argument("--apart", type=float, default=0.35)
    common.arguments(parser, steps=3000, lr=3e-3, batch=16)
    args = parser.parse_args()
    if args.measure:
        for split in ("train", "val"):
            common.save(os.path.join(args.corpus, split + ".activity.pt"), sums=measure(args.corpus, split))
        return
    if args.into:
        graft(args.into, common.load(args.flow)["ema"], people(args.data), args.out)
        return
    common.start_process(args)
    team = Team(args.workers)
    (flow, state) = load_flow(args.flow)
    windows = lambda split, **kw: Told(os.path.join(args.cache, split + ".pt"), kept(args.corpus, split), args.blocks, away=0.1, quiet=0.5, **kw)
    train, held = windows("train"), windows("val", keep=1.0, jitter=False, drop=0, drop_all=0, drop_gaze=0, prefix=0)
    if "metric" not in state:
        vae, mean, std, _ = load_vae(args.vae)
        state["metric"] = latent_metric(vae, mean, std, train.batch(24)[0][:, :16], train.mean, train.std)
    net, metric = told(flow, state), state["metric"]
    loop = Loop(team, net.train(), args, warmup=50, average=0.995, **described(state) | {"activity": HIDDEN})
    share = args.apart / (args.apart + 2.2 * (1 - args.apart))
    for step in loop:
        apart = team.draw(args.seed, step) < share
        z, cond = train.batch(args.batch)
        weight = cond.resting[..., 0]
        loss = (apart_loss if apart else shared_loss)(net, z, cond, metric, 0.15, weight / weight.mean().clamp(min=0.05), 0.0)
        loop.update(loss, **{"apart" if apart else "shared": loss})
        loop.report(50, lambda net: validate(net, held, metric), 250)
    loop.finish(lambda net: validate(net, held, metric))


if __name__ == "__main__":
    main()
