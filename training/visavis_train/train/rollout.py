"""Free-running roll-outs of a bundle in PyTorch: clips in, generated bodies out, and the few figures that tell a good model from a bad one.

    python -m visavis_train.train.rollout --bundle B --corpus DIR --split val --clips 12 --blocks 300 --gaze none,0,0.5,1 [--student] [--sheet out.png]

The agent's frame comes from its own decoded motion, as in the runtime. `visavis eval` (Rust) is the judge; this one is for use during training.
"""
import argparse
import json

import numpy as np
import torch

from .. import bundle as bundles
from ..motion import rig
from ..nets.flow import Condition, absent
from ..nets.stream import Stream, decoding
from .cache import features
from .data import clips, expand, load_motion
from .geometry import FEET, HANDS, gaze, integrate, local_positions, to_local, to_world


class Batch:
    """Clips (paths or what was read from them) of one length with everything that conditions the agent; the agent's start is the origin facing +Z."""

    def __init__(self, audio, paths, blocks):
        self.blocks, frames = blocks, 4 * blocks
        self.user, self.agent, self.voice, self.has, self.roots, self.frames, self.speaking = [], [], [], [], [], [], []
        for path in paths:
            clip, c, roots, _ = load_motion(path)
            f = features(audio, clip, len(c))
            self.user.append(torch.from_numpy(clip.user_head[:frames].copy()).double())
            self.agent.append(f["agent"][:frames].float())
            self.voice.append(f["voice"][:frames].float())
            self.has.append([float(v) for v in f["has"]])
            self.roots.append(roots[:frames])
            self.frames.append(expand(c[:frames]))
            loud = np.zeros(frames) if clip.agent_voice is None else np.abs(clip.agent_voice[:800 * frames].astype(float)).reshape(frames, 800).max(1)
            self.speaking.append(torch.from_numpy(loud > 1500))
        for name in ("user", "agent", "voice", "roots", "frames", "speaking"):
            setattr(self, name, torch.stack(getattr(self, name)))
        self.has = torch.tensor(self.has)

    def __len__(self):
        return len(self.has)


@torch.no_grad()
def roll(b, batch, target=None, student=False, steps=4, seed=0, guidance=None, gaze_guidance=None, tau_history=None, clean_from=None, temperature=None, correlation=0.0):
    """Generated feature vectors [B, T, F] in metres and roots [B, T, 3]. `target`: gaze score or None. `tau_history`, `clean_from`: see `history_time`; the bundle's by default, 1 and 2 impute history throughout.
    `temperature` scales the noise that blocks start from, the bundle's by default; `correlation`: of that noise from token to token."""
    g = torch.Generator().manual_seed(seed)
    n, session = len(batch), b.config["session"]
    latent, width = b.config["vae"]["latent"], b.config["audio"]["features"]
    clean = (None if student else session.get("clean_history")) or {"tau": None, "from": 0.0}
    tau_history, clean_from = clean["tau"] if tau_history is None else tau_history, clean["from"] if clean_from is None else clean_from
    stream = Stream(b.student if student else b.flow, n, session["guidance"] if guidance is None else guidance,
                    session["gaze_guidance"] if gaze_guidance is None else gaze_guidance, target is not None, steps,
                    b.config["student"]["tau_history"] if student else tau_history,
                    clean_from, student, session.get("guided_until"))
    heat = bundles.temperature(b.config, student) if temperature is None else temperature
    idle = b.encode(b.idle()[None]).expand(n, -1, -1)
    m = idle.shape[1]
    noise = lambda k: torch.randn(n, k, latent, generator=g)
    eps = noise(m)
    stream.warm(idle, eps, absent(n, m, width))
    eps = eps[:, -1:]
    decode, place = decoding(b.vae.decoder), lambda z: z * b.stat("latent_std") + b.stat("latent_mean")
    for i in range(m):
        decode(place(idle[:, i:i + 1]))

    def step(cond):
        nonlocal eps
        eps = correlation * eps + (1 - correlation ** 2) ** 0.5 * noise(1)
        return b.unstandardise(decode(place(stream.step(heat * eps, cond))))

    return walk(step, batch, target)


def walk(step, batch, target=None):
    """Feature vectors [B, T, F] in metres and roots [B, T, 3] of a model that goes on from block to block: `step` gives the next block's frames under a
    Condition, in which the user is seen from where the model's own agent stands."""
    n, width = len(batch), batch.agent.shape[-1]
    root, out, roots = torch.zeros(n, 3, dtype=torch.float64), [], []
    for k in range(batch.blocks):
        now, before = slice(4 * k, 4 * k + 4), slice(4 * k - 4, 4 * k)
        user = to_local(root, batch.user[:, before][..., [0, 2]]).float().reshape(n, 1, 8) if k else torch.zeros(n, 1, 8)
        voice = batch.voice[:, before].reshape(n, 1, -1) if k else torch.zeros(n, 1, 4 * width)
        known = float(k > 0)
        flags = torch.tensor([[known, 1.0, known, 1.0]]).repeat(n, 1)
        flags[:, 1:3] *= batch.has
        cond = Condition(user, batch.agent[:, now].reshape(n, 1, -1), voice, torch.full((n, 1, 4), float(target or 0)), flags[:, None])
        x = step(cond)
        path = integrate(x[..., :3].double(), root)
        root = path[:, -1]
        out.append(x)
        roots.append(path)
    return torch.cat(out, 1), torch.cat(roots, 1)


def figures(b, x, roots, batch):
    """Gaze score, wrist speed (m/s; speaking and not), foot slide and support-foot speed, seam, bone error, distance to the user."""
    r = b.config["rig"]
    g = gaze(roots.float(), x, batch.user.float(), r["eyes"], r["head_back"])
    p = to_world(roots, local_positions(x).double())
    v = p.diff(dim=1) * 30
    wrist = v[:, :, list(HANDS)].norm(dim=-1).mean(-1)
    talk = batch.speaking[:, 1:]
    feet = p[:, 1:, [16, 20]]
    speed = v[:, :, [16, 20]][..., [0, 2]].norm(dim=-1)
    low = feet[..., 1] < 0.11
    support = torch.gather(speed, -1, feet[..., 1].argmin(-1, keepdim=True))
    acc = p.diff(dim=1).diff(dim=1).norm(dim=-1).mean(-1)
    border = torch.arange(acc.shape[1]) % 4 >= 2
    parents = [j["parent"] for j in r["joints"]]
    length = torch.tensor([np.linalg.norm(j["offset"]) for j in r["joints"][1:]])
    bone = (p[:, :, 1:] - p[:, :, parents[1:]]).norm(dim=-1)
    return {"gaze": g.mean().item(), "gaze_sd": g.std().item(), "wrist": wrist.mean().item(), "wrist_talk": wrist[talk].mean().item(),
            "wrist_quiet": wrist[~talk].mean().item(), "slide": ((speed > 0.03) & low).float().mean().item(), "support": support.mean().item(),
            "seam": (acc[:, border].mean() / acc[:, ~border].mean()).item(), "bone_pct": ((bone / length - 1).abs().mean() * 100).item(),
            "floor_mm": (-p[..., 1].amin(-1).clamp(max=0).mean() * 1000).item(), "root_speed": v[:, :, 0][..., [0, 2]].norm(dim=-1).mean().item(),
            "far": (roots[..., :2] - batch.user[..., [0, 2]]).norm(dim=-1).mean().item()}


def sheet(path, rows, parents, every=15, columns=12):
    """Stick figures: one row a sequence (title, positions [T, J, 3], user [T, 3]), seen from the agent's front left."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    fig, axes = plt.subplots(len(rows), columns, figsize=(1.5 * columns, 2.4 * len(rows)), squeeze=False)
    side = np.array([np.cos(0.6), -np.sin(0.6)])
    for line, (title, p, user) in zip(axes, rows):
        for i, ax in enumerate(line):
            t = i * every
            ax.set_axis_off()
            ax.set_aspect("equal")
            if t >= len(p):
                continue
            h = p[t] - p[t, :1] * [1, 0, 1]
            flat = np.stack([h[:, [0, 2]] @ side, h[:, 1]], -1)
            for j, parent in enumerate(parents):
                if parent is not None:
                    a = flat[[j, parent]]
                    ax.plot(a[:, 0], a[:, 1], color="tab:red" if j < 10 and j > 5 or 13 < j < 18 else "tab:blue" if j > 9 else "k", lw=1.5)
            u = (user[t] - p[t, 0])[[0, 2]]
            u = u / max(1.0, np.linalg.norm(u)) * 0.5
            ax.plot([0, u @ side], [0, u @ np.array([side[1], -side[0]]) * 0 + 0.02], color="tab:green", lw=2)
            ax.set_xlim(-0.75, 0.75)
            ax.set_ylim(-0.05, 1.85)
            ax.set_title(f"{title}\n{t / 30:.1f} s" if i == 0 else f"{t / 30:.1f} s", fontsize=7)
    fig.tight_layout(pad=0.2)
    fig.savefig(path, dpi=70)
    plt.close(fig)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--bundle", required=True)
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--split", default="val")
    parser.add_argument("--kind", default="talk", help="only clips whose names start with this")
    parser.add_argument("--clips", type=int, default=8)
    parser.add_argument("--blocks", type=int, default=225)
    parser.add_argument("--gaze", default="none,0,0.5,1")
    parser.add_argument("--student", action="store_true")
    parser.add_argument("--steps", type=int, default=4)
    parser.add_argument("--guidance", type=float)
    parser.add_argument("--gaze-guidance", type=float)
    parser.add_argument("--tau-history", type=float, help="history at this flow time in evaluations from --clean-from on")
    parser.add_argument("--clean-from", type=float)
    parser.add_argument("--temperature", type=float, help="scale of the noise; default the bundle's")
    parser.add_argument("--sheet")
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    b = bundles.read(args.bundle)
    paths = []
    for path in clips(args.corpus, args.split):
        if path.split("/")[-1].startswith(args.kind) and len(paths) < args.clips and len(load_motion(path)[1]) >= 4 * args.blocks:
            paths.append(path)
    batch = Batch(b.audio, paths, args.blocks)
    show = lambda name, f: print(name.ljust(10), json.dumps({k: round(v, 3) for k, v in f.items()}), flush=True)
    show("truth", figures(b, batch.frames, batch.roots, batch))
    world = lambda x, roots: to_world(roots, local_positions(x).double())[0].numpy()
    rows = [("truth", world(batch.frames, batch.roots), batch.user[0].numpy())]
    for text in args.gaze.split(","):
        target = None if text == "none" else float(text)
        x, roots = roll(b, batch, target, args.student, args.steps, guidance=args.guidance, gaze_guidance=args.gaze_guidance,
                        tau_history=args.tau_history, clean_from=args.clean_from, temperature=args.temperature)
        show(f"gaze {text}", figures(b, x, roots, batch))
        rows.append((f"gaze {text}", world(x, roots), batch.user[0].numpy()))
    if args.sheet:
        sheet(args.sheet, rows, [j["parent"] for j in b.config["rig"]["joints"]], every=max(1, 4 * args.blocks // 12))


if __name__ == "__main__":
    main()
