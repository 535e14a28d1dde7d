"""Where a model loses the stillness of its corpus, stage by stage: corpus, VAE reconstruction, noise on latents, flow, student.

    python -m visavis_train.train.stillness --bundle B.safetensors --corpus DIR [--split test] [--clips 24] [--seconds 53] [--json out.json]
    python -m visavis_train.train.stillness --runs WORK/runs --corpus DIR --rows corpus vae flow:1:1

Share of time in which both hands are slower than 3 cm/s and the hands' speed (`corpus/measures.py`), while nobody speaks and the user stands, while
the user speaks, while the agent speaks; standard errors by the jackknife over clips. Motion is as decoded: the runtime's corrections of feet and block
borders are left out. Rows: corpus; vae; vae+N (white noise of N deviations on the latents); flow:T:G or flow:T (temperature T, guidance G, the
bundle's by default); student:T; flow:T:G:E (E: flow times between the sampler's steps, as 0,0.3,0.6,0.85,1); flow:T:G:E:C (C: correlation of the
noise from token to token, E may be empty).
"""
import argparse
import json
import os
import tempfile

import numpy as np
import torch

from .. import bundle as bundles
from ..corpus import measures, people, store
from ..motion import rig
from .data import clips
from .geometry import local_positions, to_world
from .rollout import Batch, roll

ROWS = ("corpus", "vae", "vae+0.05", "vae+0.1", "vae+0.2", "flow:0", "flow:0.4", "flow:0.75", "flow:1:1", "student:0", "student:0.4", "student:0.75")
SETTLE = 120  # frames after the idle start that are left out


def jackknife(top, bottom):
    """Ratio of sums over clips [N] and its standard error."""
    top, bottom = np.asarray(top, float), np.asarray(bottom, float)
    keep = bottom > 0
    top, bottom, n = top[keep], bottom[keep], int(keep.sum())
    if n < 2:
        return (float(top.sum() / bottom.sum()) if n else float("nan")), float("nan")
    without = (top.sum() - top) / (bottom.sum() - bottom)
    return float(top.sum() / bottom.sum()), float(np.sqrt((n - 1) / n * ((without - without.mean()) ** 2).sum()))


def tally(x, roots, masks):
    """Of one clip's features [T, F] and roots [T, 3]: {state: (still frames, sum of hand speeds, frames)} under the masks [T] bool."""
    p = to_world(roots, local_positions(x).double()).cpu().numpy()
    t = measures.tracks(p, rig.axis_mat("y", roots[:, 2].cpu().numpy())[:, None])
    still, inner = (t["hand_v"] < measures.STILL).all(1), np.arange(len(p)) >= SETTLE
    inner[-1] = False
    return {k: (still[m & inner].sum(), t["hand_v"][m & inner].mean(1).sum(), (m & inner).sum()) for k, m in masks.items()}


def row(parts):
    """{state: {"still": (value, error), "speed": (value, error), "seconds": s}} of clips' tallies."""
    out = {}
    for k in people.KINDS:
        still, speed, frames = zip(*(p[k] for p in parts))
        out[k] = {"still": jackknife(still, frames), "speed": jackknife(speed, frames), "seconds": float(sum(frames)) / rig.FPS}
    return out


class Judge:
    """Clips of one length with their states, and every row that can be asked of a bundle on them."""

    def __init__(self, b, folder, split, count, blocks, seed=0):
        paths = [p for p in clips(folder, split) if os.path.basename(p).startswith("talk") and len(store.load(p, voices=False).positions) >= 4 * blocks][:count]
        if not paths:
            raise SystemExit(f"no conversations of {blocks * 4 / 30:.0f} s under {folder}/{split}")
        self.b, self.batch, self.seed, self.masks = b, Batch(b.audio, paths, blocks), seed, []
        for path in paths:
            clip = store.load(path)
            agent, user = people.phrases(clip, "agent"), people.phrases(clip, "user")
            masks = measures.states(agent, user, len(clip.positions))
            masks["idle"] &= people.stands(clip.user_head)
            self.masks.append({k: m[:4 * blocks] for k, m in masks.items()})

    def of(self, x, roots):
        return row([tally(x[i], roots[i], m) for i, m in enumerate(self.masks)])

    @torch.no_grad()
    def vae(self, noise):
        """The corpus' motion through the VAE, with white noise on standardised latents; the roots are the corpus' own."""
        torch.manual_seed(self.seed)
        out = []
        for x in self.batch.frames:
            z = self.b.encode(x[None])
            out.append(self.b.unstandardise(self.b.decode(z + noise * torch.randn_like(z)))[0])
        return torch.stack(out), self.batch.roots

    def make(self, text):
        """Motion of a row: features [B, T, F], roots [B, T, 3]."""
        kind, *given = text.split(":")
        if text == "corpus":
            return self.batch.frames, self.batch.roots
        if kind.startswith("vae"):
            return self.vae(float(kind[4:] or 0))
        if kind not in ("flow", "student") or not 1 <= len(given) <= 4:
            raise SystemExit(f"unknown row {text!r}")
        number = lambda i: float(given[i]) if len(given) > i and given[i] else None
        steps = [float(t) for t in given[2].split(",")] if len(given) > 2 and given[2] else 4
        return roll(self.b, self.batch, student=kind == "student", temperature=number(0), guidance=number(1), steps=steps, correlation=number(3) or 0.0, seed=self.seed)


def from_runs(runs, corpus):
    """A bundle of the newest checkpoints of a training, finished or not."""
    from .. import export
    at = lambda *names: next((p for n in names if os.path.exists(p := os.path.join(runs, n))), None)
    flow = at("flow-audio.pt", "flow.pt")
    idle = export.idle_clip(corpus, "train", 64, limit=12)[0]
    audio = export.load_audio(at("flow-audio.pt", "audio.pt", "start/audio.pt"))
    tensors, config = export.assemble(audio, at("vae-fine.pt", "vae.pt"), flow, at("student.pt"), idle, "under way", "not for use")
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "bundle.safetensors")
        bundles.write(path, tensors, config)
        return bundles.read(path)


def text_of(name, r):
    cell = lambda c: f"{c['still'][0]:.2f} ± {c['still'][1]:.2f}, {c['speed'][0]:.3f} ± {c['speed'][1]:.3f}"
    return f"| {name} | " + " | ".join(cell(r[k]) for k in people.KINDS) + " |"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--bundle")
    parser.add_argument("--runs", help="checkpoints of a training, instead of a bundle")
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--split", default="test")
    parser.add_argument("--clips", type=int, default=24)
    parser.add_argument("--seconds", type=float, default=53)
    parser.add_argument("--rows", nargs="+", default=ROWS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", help="file to write the rows to")
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    if bool(args.bundle) == bool(args.runs):
        raise SystemExit("either --bundle or --runs")
    torch.set_num_threads(args.threads)
    b = bundles.read(args.bundle) if args.bundle else from_runs(args.runs, args.corpus)
    judge, made = Judge(b, args.corpus, args.split, args.clips, round(args.seconds * rig.FPS / 4), seed=args.seed), {}
    print(f"{len(judge.batch)} clips of {args.seconds:g} s\n\n| stage: share still, hand speed m/s | nobody speaks | user speaks | agent speaks |\n|---|---|---|---|")
    for name in args.rows:
        if name.startswith("student") and b.student is None:
            continue
        made[name] = judge.of(*judge.make(name))
        print(text_of(name, made[name]), flush=True)
        if args.json:
            with open(args.json, "w") as f:
                json.dump({"clips": len(judge.batch), "rows": made}, f, indent=1)


if __name__ == "__main__":
    main()
