"""How well a small convolutional net tells played motion from a corpus' motion: windows of 2 s, as many of each.

    visavis eval --model B.safetensors --clips DIR --keep KEPT
    python -m visavis_train.train.tell --motion KEPT [--rows VAE midpoint4 other]

The rows are the folders that `visavis eval --keep` wrote, motion on the rig as it is played; `other` is the corpus' motion of another clip of the same
half, real motion that cannot be told. For each row a net is trained on one half of the source clips and judged on the other, then the other way
round, each with `--nets` seeds; a clip and its mirror image are on one side. It sees joint positions in the heading frame, their velocities and the
root's step; the root is the floor under the hips in every row. Printed: accuracy on windows it was not trained on, its standard error by the
jackknife over clips, and accuracy in windows in which the corpus' hands are still. 0.5 is chance, 1 is always told.
"""
import argparse
import os
from collections import Counter

import numpy as np
import torch
from torch import nn

from ..corpus import measures, store
from ..motion import rig
from ..motion.features import to_features
from .geometry import local_positions
from .stillness import jackknife

FRAMES = 60    # of a window: 2 s
STRIDE = 15    # between the starts of windows


def seen(x):
    """Features [..., T, F] in metres -> what the net sees [..., T - 1, 6 J + 3], in units of about one."""
    p = local_positions(x)
    return torch.cat([p[..., 1:, :, :].flatten(-2), (20 * p.diff(dim=-3)).flatten(-2), 30 * x[..., 1:, :3]], -1)


def windows(x):
    """Clips [N, T, C] -> windows [N, W, FRAMES, C]."""
    return x.unfold(1, FRAMES, STRIDE).transpose(2, 3)


class Net(nn.Module):
    """A window [B, T, C] -> the logit of its being generated."""

    def __init__(self, inputs, width=48):
        super().__init__()
        step = lambda i: [nn.Conv1d(i, width, 5, stride=2), nn.SiLU(), nn.Dropout(0.2)]
        self.layers = nn.Sequential(*step(inputs), *step(width), *step(width))
        self.out = nn.Linear(2 * width, 1)

    def forward(self, x):
        h = self.layers(x.transpose(1, 2))
        return self.out(torch.cat([h.mean(2), h.amax(2)], 1))[:, 0]


def train(real, made, steps, seed, batch=64, lr=2e-3):
    """A net trained on windows [N, T, C] of both kinds, and what standardises them."""
    torch.manual_seed(seed)
    both = torch.cat([real, made])
    mean, std = both.mean((0, 1)), both.std((0, 1)).clamp(min=1e-4)
    net = Net(real.shape[2]).train()
    optim = torch.optim.AdamW(net.parameters(), lr=lr, weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optim, steps)
    truth = torch.cat([torch.zeros(batch // 2), torch.ones(batch // 2)])
    for _ in range(steps):
        x = torch.cat([k[torch.randint(0, len(k), (batch // 2,))] for k in (real, made)])
        loss = nn.functional.binary_cross_entropy_with_logits(net((x - mean) / std), truth)
        optim.zero_grad()
        loss.backward()
        optim.step()
        schedule.step()
    net.eval()
    return lambda x: net((x - mean) / std)


def told(real, made, half, steps=600, nets=2, seed=0):
    """Shares of windows [N clips, W] that are told right, by nets that were trained on the clips of the other half; real and generated
    windows [N, W, T, C] of the same clips count alike. `half` [N] bool says which half a clip is of. Mean over `nets`."""
    right = torch.zeros(real.shape[:2])
    for side in (False, True):
        for n in range(nets):
            net = train(*(k[half != side].flatten(0, 1) for k in (real, made)), steps, seed + n)
            with torch.no_grad():
                score = lambda k: net(k[half == side].flatten(0, 1)).unflatten(0, (-1, real.shape[1]))
                right[half == side] += ((score(real) < 0).float() + (score(made) >= 0).float()) / (2 * nets)
    return right


def halves(sources):
    """Which half each of N pieces is of, [N] bool: pieces of one source in one half, both about as large."""
    count, size, half = Counter(sources), [0, 0], {}
    for source in sorted(count, key=lambda s: (-count[s], s)):
        half[source] = size[1] < size[0]
        size[half[source]] += count[source]
    return torch.tensor([half[s] for s in sources])


def others(sources, half):
    """For each of N pieces one of another source of the same half, each once: a permutation [N]. No source may have more than half of a half."""
    out = torch.arange(len(sources))
    for side in (False, True):
        at = sorted((i for i in range(len(sources)) if half[i] == side), key=lambda i: sources[i])
        most = max(Counter(sources[i] for i in at).values(), default=0)
        for i, j in zip(at, at[most:] + at[:most]):
            out[i] = j
    return out


def resting(positions, rotations):
    """Windows [N, W] bool of positions [N, T, J, 3] and matrices [N, T, J, 3, 3] in which both hands are still for most of the time."""
    still = [torch.from_numpy((measures.tracks(p, r)["hand_v"] < measures.STILL).all(1)[1:]) for p, r in zip(positions, rotations)]
    return windows(torch.stack(still)[..., None].float())[..., 0].mean(-1) > 0.75


def source_of(clip):
    """The recording that a clip's file is of: its name, a mirror image's being that of what it mirrors."""
    return clip.meta.get("clip", "").removesuffix(".safetensors").removesuffix("_mirror")


def read(folder, row):
    """The clips of a row, in the order of their numbers."""
    path = os.path.join(folder, row)
    if not os.path.isdir(path):
        raise SystemExit(f"{path}: no such folder; write it with visavis eval --keep {folder}")
    names = sorted((f for f in os.listdir(path) if f.endswith(".safetensors")), key=lambda f: (len(f), f))
    try:
        return {name: store.load(os.path.join(path, name), voices=False) for name in names}
    except store.ClipError as e:
        raise SystemExit(str(e)) from None


def like(corpus, row, name):
    """A row's clips in the order of the corpus', of the same windows and as long."""
    for file, c in corpus.items():
        r = row.get(file)
        if r is None or len(r.positions) != len(c.positions) or any(r.meta.get(k, c.meta[k]) != c.meta[k] for k in ("clip", "first_frame")):
            raise SystemExit(f"{name}/{file} is missing or not of the window that corpus/{file} is of; write both with one visavis eval --keep")
    return [row[file] for file in corpus]


def seen_of(clips):
    """Clips -> windows [N, W, FRAMES, C] of what the net sees."""
    features = (torch.from_numpy(to_features(c.positions, c.rotations)).float() for c in clips)
    return windows(torch.stack([seen(x) for x in features]))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--motion", required=True, help="folder that visavis eval --keep wrote")
    parser.add_argument("--rows", nargs="+", help="all that there are, and other, by default")
    parser.add_argument("--steps", type=int, default=600)
    parser.add_argument("--nets", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    corpus = read(args.motion, "corpus")
    clips = list(corpus.values())
    sources = [source_of(c) for c in clips]
    if len(set(sources)) < 4 or "" in sources:
        raise SystemExit(f"{args.motion}/corpus: {len(set(sources))} source clips; four are needed, two for each half. Evaluate more --clips")
    half = halves(sources)
    real = seen_of(clips)
    rest = resting([c.positions.astype(np.float64) for c in clips], [rig.quat_to_mat(c.rotations) for c in clips])
    number = torch.tensor([sorted(set(sources)).index(s) for s in sources])
    by_source = lambda x: torch.zeros(len(set(sources))).index_add(0, number, x.sum(1))
    rows = args.rows or sorted(r for r in os.listdir(args.motion) if r != "corpus" and os.path.isdir(os.path.join(args.motion, r))) + ["other"]
    print(f"{len(clips)} pieces of {len(set(sources))} clips, {real.shape[1]} windows of each kind in each\n\n| row | told apart | at rest |\n|---|---|---|")
    for name in rows:
        made = real[others(sources, half)] if name == "other" else seen_of(like(corpus, read(args.motion, name), name))
        right = told(real, made, half, args.steps, args.nets, args.seed)
        cells = (jackknife(by_source(right * m), by_source(m)) for m in (torch.ones_like(right), rest.float()))
        print(f"| {name} | " + " | ".join(f"{v:.3f} ± {e:.3f}" for v, e in cells) + " |", flush=True)


if __name__ == "__main__":
    main()
