"""What a model does about sounds that interrupt conversations: roll-outs over clips of a corpus with sounds, judged beside the corpus itself.

    python -m visavis_train.hearing.evaluate --corpus WORK/hearing --cache runs/cache-hearing --split test --bundle B.safetensors [--student] --out e.json

A roll-out begins with two seconds of the corpus; the sound comes 2 to 3 s later. What is heard is the corpus' but for the place, which is told as the generated body
stands. Which reaction a stretch of motion is, a small classifier says that is trained on the corpus' train split (its own accuracy on the split: row "corpus").
False alarms are what another one, which has learnt quiet motion too, takes for a reaction while nothing sounds.
"""
import argparse
import json
import os

import numpy as np
import torch
from torch import nn

from .. import bundle as bundles
from ..corpus import store
from ..motion import rig
from ..mospa.react import REACTIONS, TURNS
from ..nets.flow import GAZE
from ..nets.stream import DecoderStream, Stream, reacting
from ..train.data import Split, expand
from ..train.geometry import gaze, integrate, local_axes, local_positions, to_local, to_world
from ..train.windows import Windows
from . import ears

WARM, BLOCKS, BEFORE = 16, 72, 20     # blocks of the corpus, of a window; blocks from a window's begin to the sound
SEEN = 105                            # frames from the onset on that the classifier sees, every third
HEAD = rig.INDEX["head"]


def events(corpus, split, cache):
    """[(row of the cache's segments, first block, event, onset in the window)] of sounds with room before and behind them."""
    state, out = Windows(cache, BLOCKS, 0, 0, 0, 0, jitter=False), []
    names = torch.load(cache, mmap=True, weights_only=True)["names"]
    for row in state.segments[::2].tolist():              # one phase of two
        clip, length = row[0], row[3]
        first = row[1] - int(state.starts[clip])
        if not names[clip].startswith("hear_"):
            continue
        meta = store.load(os.path.join(corpus, split, names[clip]), False).meta
        for e in json.loads(meta["events"]):
            at = (e["onset"] - first) // 4 - BEFORE
            if at >= 1 and at + BLOCKS <= length:
                out.append((torch.tensor(row), at, e | {"genre": meta["genre"]}, e["onset"] - first - 4 * at))
    return state, out


def moved(positions, roots, places, onset):
    """What the classifier sees of bodies [B, T, J, 3] with roots [B, T, 3] from frames onset [B] on: joints in the frame of the root at the onset, and the source."""
    index = onset[:, None] + torch.arange(0, SEEN, 3)
    at = torch.arange(len(onset))
    start = roots[at, onset]
    p = positions[at[:, None], index]
    floor = to_local(start, p[..., [0, 2]].flatten(1, 2).double()).unflatten(1, p.shape[1:3])
    p = torch.cat([floor, p[..., 1:2].double()], -1).flatten(2)
    source = to_local(start, places[:, None, [0, 2]].double())
    return torch.cat([p, source.expand(-1, p.shape[1], -1)], -1).float()


class Judge(nn.Module):
    def __init__(self, width):
        super().__init__()
        self.net = nn.Sequential(nn.Conv1d(width, 64, 5, 2, 2), nn.GELU(), nn.Dropout(0.3), nn.Conv1d(64, 64, 5, 2, 2), nn.GELU(), nn.Dropout(0.3), nn.AdaptiveAvgPool1d(3), nn.Flatten(),
                                 nn.Linear(192, len(REACTIONS)))

    def forward(self, x):
        return self.net(x.transpose(1, 2))


def flipped(x):
    """The same in a mirror."""
    j = torch.tensor(rig.MIRROR)
    p, source = x[..., :-2].unflatten(-1, (-1, 3)), x[..., -2:]
    return torch.cat([(p[..., j, :] * torch.tensor([-1.0, 1, 1])).flatten(-2), source * torch.tensor([-1.0, 1])], -1)


def train_judge(x, y, epochs=60, seed=0):
    torch.manual_seed(seed)
    net, mean, std = Judge(x.shape[-1]), x.mean((0, 1)), x.std((0, 1)) + 0.05
    optim = torch.optim.AdamW(net.parameters(), 2e-3, weight_decay=1e-2)
    for _ in range(epochs):
        for part in torch.randperm(len(x)).split(64):
            optim.zero_grad()
            rows = torch.where(torch.rand(len(part), 1, 1) < 0.5, x[part], flipped(x[part]))
            loss = nn.functional.cross_entropy(net((rows - mean) / std + 0.02 * torch.randn_like(rows)), y[part])
            loss.backward()
            optim.step()
    net.eval()
    return torch.no_grad()(lambda x: net((x - mean) / std))


@torch.no_grad()
def roll(b, w, chosen, student=False, seed=0, hears="sounds"):
    """Generated positions [B, T, J, 3], roots, gaze scores and yaws of the head of windows (`events`). `hears`: "sounds", "silence" in their place, or
    "nothing" (no hearing)."""
    torch.manual_seed(seed)
    segment, at = torch.stack([c[0] for c in chosen]), torch.tensor([c[1] for c in chosen])
    z, cond = w.read(segment, at)
    hushed = silenced(w, cond.sound)
    if hears == "nothing":
        cond.heard.zero_()
    elif hears == "silence":
        cond.sound = hushed
    frames, n, session, room = w.frames(segment, at), len(at), b.config["session"], b.config["hearing"]
    cond.flags[..., GAZE] = 1
    settings = dict(student=True, tau=b.config["student"]["tau_history"]) if student else dict(student=False, tau=session["clean_history"]["tau"])
    stream = Stream(b.student if student else b.flow, n, session["guidance"], session["gaze_guidance"], True, 4, settings["tau"], session["clean_history"]["from"], student,
                    session.get("guided_until"))
    eps = bundles.temperature(b.config, student) * torch.randn_like(z)
    stream.warm(z[:, :WARM], eps[:, :WARM], cond.at(slice(WARM)))
    decoder, placed = DecoderStream(b.vae.decoder), lambda z: z * b.stat("latent_std") + b.stat("latent_mean")
    root = w.roots[frames[:, 3]]
    out, roots = [], []
    for k in range(BLOCKS):
        now = slice(k, k + 1)
        if k < WARM:
            new = z[:, now]
        else:
            cond.user[:, k] = to_local(root, w.user[frames[:, 4 * k:4 * k + 4]][..., [0, 2]].double()).float().flatten(1)
            if hears == "sounds":
                cond.sound[:, k] = w.room(segment, frames[:, 4 * k:4 * k + 4], root[:, None])[0][:, 0]
            share = ears.called(cond.sound[:, now], w.sound_features, len(room["appraisal"]["reactions"])) * cond.heard[:, now, 0]
            new = stream.step(eps[:, now], cond.at(now), reacting(session["guidance"], share, room.get("guidance", 1.0)))
        x = b.unstandardise(decoder.step(placed(new)))
        path = integrate(x[..., :3].double(), root)
        root = path[:, -1]
        out.append(x)
        roots.append(path)
    x, roots = torch.cat(out, 1), torch.cat(roots, 1)
    user = w.user[frames[:, 4:]]
    r = b.config["rig"]
    score = gaze(roots.float(), x, user.float(), r["eyes"], r["head_back"])
    return to_world(roots, local_positions(x).double()), roots, score, facing(x, roots)


def silenced(w, sound):
    """Sound vectors [B, K, S] with silence in the place of sounds, sensitivity kept."""
    n = 4 * w.sound_features
    out = torch.zeros_like(sound)
    out[..., :n], out[..., n:n + 8], out[..., -1] = w.silence.repeat(4), ears.SILENT, sound[..., -1]
    return out


def quiet(corpus, split, limit=None):
    """Positions [B, SEEN, J, 3] and roots of the corpus' stretches in which nothing sounds and nobody reacts, a second after that at the earliest; of at most
    `limit` clips."""
    clips, out = Split(corpus, split), []
    for i, path in list(enumerate(clips.paths))[:limit]:
        first, frames = int(clips.starts[i]), int(clips.starts[i + 1] - clips.starts[i])
        busy = np.zeros(frames, bool)
        for e in json.loads(store.load(path, False).meta["events"]):
            busy[e["onset"]:max(e["until"], e["end"]) + 30] = True
        t = 0
        while t + SEEN <= frames:
            if busy[t:t + SEEN].any():
                t += 10
                continue
            x, roots = expand(clips.frames[first + t:first + t + SEEN]), clips.roots[first + t:first + t + SEEN]
            out.append((to_world(roots, local_positions(x).double()), roots))
            t += SEEN
    return [torch.stack(part) for part in zip(*out)]


def unprompted(run, begin=0, seed=0):
    """What the classifier sees of motion [B, T], from frame `begin` on, in which nothing sounds, towards places drawn as sounds' are."""
    positions, roots = run[:2]
    rng, out = np.random.default_rng(seed), []
    for first in range(begin, positions.shape[1] - SEEN + 1, SEEN):
        onset = torch.full((len(positions),), first)
        angle, far = rng.uniform(-np.pi, np.pi, len(positions)), rng.uniform(1, 5, len(positions))
        near = roots[:, first]
        places = torch.stack([near[:, 0] + torch.tensor(far * np.sin(angle)), torch.full((len(positions),), 1.2), near[:, 1] + torch.tensor(far * np.cos(angle))], 1)
        out.append(moved(positions, roots, places, onset))
    return torch.cat(out)


def reacts(logits):
    """Log odds [B] of any reaction."""
    return logits[:, 1:].logsumexp(-1) - logits[:, 0]


def alarms(x, judge, least):
    """Reactions that the judge sees in ten minutes of motion `x` in which nothing sounds: log odds above `least`."""
    logits = judge(x)
    seen, told = reacts(logits) > least, logits[:, 1:].argmax(-1) + 1
    minutes = len(x) * SEEN / 30 / 60
    return {"minutes": round(minutes, 1), "in_ten_minutes": round(10 / minutes * int(seen.sum()), 2), "told": {r: int((told[seen] == i).sum()) for i, r in enumerate(REACTIONS) if i}}


def facing(x, roots):
    """Yaw of the head [B, T] in the world."""
    z = local_axes(x, HEAD)[..., 2]
    return torch.atan2(z[..., 0], z[..., 2]) + roots[..., 2]


def truth(w, corpus_split, chosen, b):
    """The corpus' own motion of the windows, as `roll` gives it."""
    clips = Split(*corpus_split)
    frames = torch.stack([c[0][1] + 4 * c[1] + torch.arange(4 * BLOCKS) for c in chosen])
    x, roots = expand(clips.frames[frames]), clips.roots[frames]
    return to_world(roots, local_positions(x).double()), roots, clips.gaze[frames], facing(x, roots)


def figures(run, chosen, judge):
    """Of roll-outs: accuracy of reactions, angles, reaction times, left-right confusions, return to the user."""
    positions, roots, score, head = run
    onset = torch.tensor([c[3] for c in chosen])
    places = torch.tensor(np.array([c[2]["place"] for c in chosen]), dtype=torch.float64)
    wanted = [c[2]["reaction"] for c in chosen]
    at = torch.arange(len(chosen))
    told = judge(moved(positions, roots, places, onset)).argmax(-1)
    right = told == torch.tensor([REACTIONS.index(r) for r in wanted])

    def bearing(t):
        d = places[:, [0, 2]] - roots[at, t, :2]
        return torch.atan2(d[:, 0], d[:, 1])

    t15 = onset + 45
    hips = roots[..., 2]
    turns = torch.tensor([r in TURNS for r in wanted])
    body, eyes = rig.wrap(bearing(t15) - hips[at, t15]).abs() * 57.3, rig.wrap(bearing(t15) - head[at, t15]).abs() * 57.3
    first = rig.wrap(bearing(onset) - hips[at, onset])
    turned = rig.wrap(hips[at, t15] - hips[at, onset])
    aside = turns & (first.abs() > 0.5) & (first.abs() < 2.64) & (turned.abs() > 0.26)
    speed = rig.wrap(head.diff(dim=1)).abs() * 30
    wrists = [rig.INDEX["leftHand"], rig.INDEX["rightHand"]]
    local = positions - positions[:, :, :1]
    hands = local[:, :, wrists].diff(dim=1).norm(dim=-1).amax(-1) * 30
    start = []
    for i in range(len(chosen)):
        if wanted[i] == "stay":
            continue
        calm = max(float(speed[i, onset[i] - 15:onset[i]].max()), 0.5), max(float(hands[i, onset[i] - 15:onset[i]].max()), 0.3)
        move = (speed[i, onset[i] + 1:onset[i] + 60] > calm[0] + 0.7) | (hands[i, onset[i] + 1:onset[i] + 60] > calm[1] + 0.4)
        if move.any():
            start.append(float(move.float().argmax()) / 30)
    back = []
    for i, c in enumerate(chosen):
        over = c[3] + max(c[2]["until"], c[2]["end"]) - c[2]["onset"]
        if wanted[i] in ("stay", "dance") or over + 45 > positions.shape[1]:
            continue
        level = score[i, max(0, onset[i] - 45):onset[i]].mean()
        late = score[i, over:].unfold(0, 15, 1).mean(-1) > level - 0.2
        back.append(float(late.float().argmax()) / 30 if late.any() else 9.0)
    by = {r: round(float(right[torch.tensor([v == r for v in wanted])].float().mean()), 3) for r in REACTIONS if r in wanted}
    return {"events": len(chosen), "right": round(float(right.float().mean()), 3), "right_by": by, "body_angle": round(float(body[turns].median()), 1),
            "head_angle": round(float(eyes[turns].median()), 1), "left_right": round(float((turned * first < 0)[aside].float().mean()), 3), "turns": int(aside.sum()),
            "start": round(float(np.median(start)), 3), "started": round(len(start) / max(1, sum(r != "stay" for r in wanted)), 3), "back": round(float(np.median(back)), 2) if back else None,
            "told": {r: int((told == i).sum()) for i, r in enumerate(REACTIONS)}}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    for name in ("corpus", "cache", "bundle", "out"):
        parser.add_argument(f"--{name}", required=True)
    parser.add_argument("--split", default="test")
    parser.add_argument("--student", action="store_true")
    parser.add_argument("--limit", type=int, default=160)
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    b = bundles.read(args.bundle)
    w, known = events(args.corpus, "train", os.path.join(args.cache, "train.pt"))
    seen = truth(w, (args.corpus, "train"), known, b)
    label = lambda chosen: torch.tensor([REACTIONS.index(c[2]["reaction"]) for c in chosen])
    where = lambda chosen: (torch.tensor(np.array([c[2]["place"] for c in chosen])), torch.tensor([c[3] for c in chosen]))
    x, y = moved(seen[0], seen[1], *where(known)), label(known)
    judge = train_judge(x, y)
    # Another one for false alarms, which has seen quiet motion too; its threshold finds 90 % of the reactions of the val split.
    calm = unprompted(quiet(args.corpus, "train", 160))
    watch = train_judge(torch.cat([x, calm]), torch.cat([y, torch.zeros(len(calm), dtype=torch.long)]))
    w, held = events(args.corpus, "val", os.path.join(args.cache, "val.pt"))
    seen = truth(w, (args.corpus, "val"), held, b)
    odds = reacts(watch(moved(seen[0], seen[1], *where(held))))[label(held) != 0]
    least = float(odds.quantile(0.1))
    w, chosen = events(args.corpus, args.split, os.path.join(args.cache, args.split + ".pt"))
    chosen = chosen[:: max(1, len(chosen) // args.limit)][:args.limit]
    out = {"corpus": figures(truth(w, (args.corpus, args.split), chosen, b), chosen, judge)}
    for name, hears in (("model", "sounds"), ("without sounds", "nothing"), ("silence", "silence")):
        parts = [roll(b, w, chosen[i:i + 40], args.student, i, hears) for i in range(0, len(chosen), 40)]
        run = [torch.cat(p) for p in zip(*parts)]
        out[name] = figures(run, chosen, judge) if hears != "silence" else alarms(unprompted(run, 4 * BEFORE), watch, least)
    out["quiet corpus"] = alarms(unprompted(quiet(args.corpus, args.split)), watch, least)
    with open(args.out, "w") as f:
        json.dump(out, f, indent=1)
    print(json.dumps(out, indent=1))


if __name__ == "__main__":
    main()
