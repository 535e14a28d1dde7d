"""What the tier trains on: poses, voices' features and the user of each clip, computed once.

    python -m visavis_train.dram.data --corpus DIR --audio runs/audio.pt --out WORK/dram [--every 2]

Writes OUT/{train,val,test}/*.npy and OUT/hush.npy, the features of a voice of zeros. Conversations of a corpus without the user's head rotations get them as `corpus/partner.py` derives them.
"""
import argparse
import functools
import json
import os

import numpy as np
import torch

from ..corpus import attention, partner, store
from ..motion import rig
from ..train import cache, common
from ..train.geometry import turn
from . import nets, pose

ARRAYS = {"y": np.float32, "roots": np.float64, "head": np.float32, "forward": np.float32, "turned": np.float32, "gaze": np.float32,
          "agent": np.float16, "voice": np.float16, "has": np.float32, "speaks": bool, "hears": bool, "nods": bool}


def clip_arrays(path, audio):
    """The arrays [T, ...] of one clip."""
    clip = partner.extend(store.load(path), os.path.basename(path))
    p, r = clip.positions.astype(np.float64), rig.quat_to_mat(clip.rotations)
    y, roots = pose.from_world(p, r)
    n, f = len(y), cache.features(audio, clip, len(y))
    seen, phrases = clip.user_head_rotation, [json.loads(clip.meta.get(k, "[]")) for k in ("agent_phrases", "user_phrases")]
    nods = np.zeros(n, bool)
    for a, b in json.loads(clip.meta.get("user_nods", "[]")):
        nods[a:b] = True
    return {"y": y.numpy(), "roots": roots.numpy(), "head": clip.user_head, "gaze": rig.gaze_score(p, r, clip.user_head),
            "forward": np.zeros((n, 3)) if seen is None else rig.quat_to_mat(seen)[..., 2], "turned": np.full(n, seen is not None),
            "agent": f["agent"].numpy(), "voice": f["voice"].numpy(), "has": np.tile(np.array(f["has"], np.float32), (n, 1)),
            "speaks": attention.mask(phrases[0], n), "hears": attention.mask(phrases[1], n), "nods": nods}


def frame_rows(roots, head, forward, gaze, flags):
    """User's rows [..., U] seen from roots [..., 3]; head, forward [..., 3] in the world, flags [..., 3] (position, rotation, gaze)."""
    d = (head[..., [0, 2]].double() - roots[..., :2]).float()
    yaw = roots[..., 2].float()
    x, z = turn(-yaw, d[..., 0], d[..., 1])
    fx, fz = turn(-yaw, forward[..., 0], forward[..., 2])
    return nets.user_row(torch.stack([x, head[..., 1], z], -1), torch.stack([fx, forward[..., 1], fz], -1), gaze, flags)


class Window:
    """A batch of stretches [B, T, ...]. `heard` says what is given for frames first .. T - 1."""

    def __init__(self, rows, flags, gaze):
        self.__dict__.update(rows)
        self.flags, self.wanted = flags, gaze          # [B, 5]: agent's voice, user's voice, head, its rotation, gaze score

    @property
    def frames(self):
        return self.y.shape[1]

    def heard(self, first, last, roots=None):
        """Inputs of frames first .. last - 1 (first at least 4); `roots` [B, last - first, 3]: the agent's in the frames before, the corpus' by default."""
        roots = self.roots[:, first - 1:last - 1] if roots is None else roots
        then, now = slice(first - nets.DELAY, last - nets.DELAY), slice(first, last)
        f = self.flags[:, None, :].expand(-1, last - first, -1)
        row = frame_rows(roots, self.head[:, then], self.forward[:, then], self.wanted[:, None].expand(-1, last - first),
                         torch.stack([f[..., 2], f[..., 3] * self.turned[:, then], f[..., 4]], -1))
        return nets.Heard(nets.voice(self.agent[:, now].float(), f[..., :1]), row, nets.voice(self.voice[:, then].float(), f[..., 1:2]))


class Split:
    """The arrays of a split, mapped; windows of them."""

    def __init__(self, folder, split):
        place = os.path.join(folder, split)
        if not os.path.exists(os.path.join(place, "starts.npy")):
            raise SystemExit(f"{place} has no arrays; python -m visavis_train.dram.data makes them")
        self.starts = torch.from_numpy(np.load(os.path.join(place, "starts.npy")))
        for name in ARRAYS:
            setattr(self, name, torch.from_numpy(np.load(os.path.join(place, name + ".npy"), mmap_mode="c")))
        with open(os.path.join(place, "names.json")) as f:
            self.names = json.load(f)
        self.hush = torch.from_numpy(np.load(os.path.join(folder, "hush.npy")))
        self.talk = torch.tensor([n.startswith("talk") for n in self.names])

    @functools.cached_property
    def moments(self):
        """Mean, deviation and deviation of steps of y."""
        y = self.y[::7]
        at = torch.cat([torch.arange(a + 1, b, 7) for a, b in zip(self.starts[:-1].tolist(), self.starts[1:].tolist())])
        return y.mean(0), y.std(0), (self.y[at] - self.y[at - 1]).square().mean(0).sqrt()

    def statistics(self, layout):
        """Mean and deviation of y, and the deviation of its steps in units of it; the numbers of a joint share theirs."""
        mean, std, step = self.moments
        share = lambda v, least: torch.cat([v[:pose.LEAD], v[pose.LEAD:].unflatten(0, (-1, 6)).square().mean(-1).sqrt().clamp(min=least).repeat_interleave(6)])
        std, step = share(std, 0.02), share(step, 2e-4)
        return tuple(layout.take(v) for v in (mean, std, step / std))

    def at(self, clips, first, frames, drop=None):
        """The stretches that begin at frames `first` [B] of the split; `drop` draws which inputs are left out, None keeps all but the gaze score."""
        index = torch.as_tensor(first)[:, None] + torch.arange(frames)
        rows = {name: getattr(self, name)[index] for name in ("y", "roots", "head", "forward", "turned", "gaze", "agent", "voice", "speaks", "hears", "nods")}
        has = self.has[index[:, 0]]
        flags = torch.cat([has, torch.ones(len(has), 3)], 1)
        if drop is None:
            flags[:, 4] = 0
        else:
            keep = (torch.rand(len(has), 5) >= torch.tensor(drop)).float()
            keep[:, 3] *= keep[:, 2]
            flags = flags * keep
        return Window(rows, flags, rows["gaze"].mean(1))

    def sample(self, batch, frames, drop=(0.05, 0.05, 0.05, 0.2, 0.4)):
        lengths = self.starts.diff()
        weights = lengths * (lengths >= frames) * torch.where(self.talk, 1.0, 0.5)
        clip = torch.multinomial(weights.float(), batch, replacement=True)
        at = (torch.rand(batch, dtype=torch.float64) * (lengths[clip] - frames + 1)).long()
        return self.at(clip, self.starts[clip] + at, frames, drop)

    def spread(self, windows, frames, talk=True):
        """First frames of up to `windows` stretches, evenly over the conversations."""
        every = [(c, a) for c in range(len(self.names)) if self.talk[c] or not talk
                 for a in range(int(self.starts[c]) + 1, int(self.starts[c + 1]) - frames, frames)]
        return [every[int(i * len(every) / windows)] for i in range(min(windows, len(every)))] if every else []


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--audio", required=True, help="checkpoint of train.audio")
    parser.add_argument("--out", required=True)
    parser.add_argument("--every", type=int, default=1, help="of train, take one clip in so many [1]")
    parser.add_argument("--splits", default="val,test,train")
    args = parser.parse_args()
    torch.set_num_threads(1)
    audio = cache.load_audio(args.audio)
    os.makedirs(args.out, exist_ok=True)
    np.save(os.path.join(args.out, "hush.npy"), cache.listen(audio, np.zeros(800 * 60, np.int16), 60)[-1].float().numpy())
    for split in args.splits.split(","):
        paths = store.list_clips(args.corpus, split)[::args.every if split == "train" else 1]
        place, made, starts = os.path.join(args.out, split), {name: [] for name in ARRAYS}, [0]
        for path in paths:
            for name, value in clip_arrays(path, audio).items():
                made[name].append(np.asarray(value).astype(ARRAYS[name]))
            starts.append(starts[-1] + len(made["y"][-1]))
        os.makedirs(place, exist_ok=True)
        for name, parts in made.items():
            np.save(os.path.join(place, name + ".npy"), np.concatenate(parts))
        with open(os.path.join(place, "names.json"), "w") as f:
            json.dump([os.path.basename(p) for p in paths], f)
        np.save(os.path.join(place, "starts.npy"), np.array(starts))
        print(f"{split}: {len(paths)} clips, {starts[-1] / 108000:.2f} hours", flush=True)


if __name__ == "__main__":
    main()
