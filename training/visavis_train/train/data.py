"""A corpus as training arrays: every clip of a split, one after the other, in memory-mapped files beside the split.

A frame is kept compactly as (vx, vz, dyaw), then position and rotation matrix of each joint in the heading frame: 3 + 12 J
numbers, which `expand` turns into the 3 + 36 J of a feature vector. A corpus is DIR/{train,val,test}/*.safetensors in the
format of `corpus/store.py`; one's own captures come in the same format.
"""
import argparse
import json
import os
import shutil
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import torch
from safetensors import safe_open

from ..corpus import store
from ..motion import rig
from ..motion.features import root_of
from .forms import ICOSAHEDRA, expand

COMPACT = 3 + 12 * rig.J
ARRAYS = {"frames": ((COMPACT,), np.float32), "roots": ((3,), np.float64), "user": ((3,), np.float32), "gaze": ((), np.float32)}
VOICES = {"voices": ((2, rig.SAMPLES_PER_FRAME), np.int16)}


def compact(positions, quats):
    """positions [T, J, 3], quats [T, J, 4] world -> compact frames [T, 3 + 12 J] f32 and roots [T, 3] (x, z, yaw) f64."""
    rot = rig.quat_to_mat(quats)
    pos = np.asarray(positions, dtype=np.float64)
    root, yaw = root_of(pos, rot)
    inv = rig.axis_mat("y", -yaw)
    base = np.stack([root[:, 0], np.zeros_like(yaw), root[:, 1]], -1)
    p = np.einsum("tab,tjb->tja", inv, pos - base[:, None])
    r = inv[:, None] @ rot
    step = np.einsum("tab,tb->ta", inv[:-1], base[1:] - base[:-1])
    first = np.zeros((len(pos), 3))
    first[1:, 0], first[1:, 1], first[1:, 2] = step[:, 0], step[:, 2], rig.wrap(np.diff(yaw))
    flat = np.concatenate([first, p.reshape(len(p), -1), r.reshape(len(p), -1)], -1).astype(np.float32)
    return flat, np.stack([root[:, 0], root[:, 1], np.unwrap(yaw)], -1)


def load_motion(path, voices=True):
    """One clip (a path, or what was read from it): its store.Clip, compact frames, roots [T, 3] and gaze score [T]."""
    clip = path if isinstance(path, store.Clip) else store.load(path, voices)
    frames, roots = compact(clip.positions, clip.rotations)
    g = rig.gaze_score(clip.positions.astype(np.float64), rig.quat_to_mat(clip.rotations), clip.user_head)
    return clip, torch.from_numpy(frames), torch.from_numpy(roots), torch.from_numpy(g.astype(np.float32))


def clips(folder, split):
    return store.list_clips(folder, split) if os.path.isdir(os.path.join(folder, split)) else []


def _head(path):
    """A clip's name, size in bytes, frames, whether it is a conversation, which voices it has."""
    with safe_open(path, framework="numpy") as f:
        keys, talk = set(f.keys()), (f.metadata() or {}).get("kind") == "talk"
        return [os.path.basename(path), os.path.getsize(path), f.get_slice("user_head").get_shape()[0], talk, "agent_voice" in keys, "user_voice" in keys]


def _fill(job):
    """Writes one clip into the arrays of `folder` from frame `at` on."""
    path, folder, at, names = job
    clip, frames, roots, gaze = load_motion(path, "voices" in names)
    values = {"frames": frames, "roots": roots, "user": clip.user_head, "gaze": gaze}
    if "voices" in names:
        values["voices"] = np.stack([np.zeros((len(frames), rig.SAMPLES_PER_FRAME), np.int16) if v is None else v.reshape(len(frames), -1)
                                     for v in (clip.agent_voice, clip.user_voice)], 1)
    for name in names:
        np.load(os.path.join(folder, name + ".npy"), mmap_mode="r+")[at:at + len(frames)] = values[name]


class Split:
    """The clips of DIR/SPLIT as arrays over all N frames: frames [N, 3 + 12 J], roots [N, 3], user [N, 3], gaze [N] and, when asked for,
    voices [N, 2, 800] i16 (agent, user; zeros where absent).

    `starts` [clips + 1]: each clip's first frame; `talk` and `has` [clips, 2]: is it a conversation, has it voices. The arrays are made when
    they are first asked for, by `workers` processes, and anew when the clips change."""

    def __init__(self, folder, split, voices=False, workers=1):
        self.paths = clips(folder, split)
        heads = [_head(p) for p in self.paths]
        self.names = [h[0] for h in heads]
        self.talk = torch.tensor([h[3] for h in heads], dtype=torch.bool)
        self.has = torch.tensor([h[4:] for h in heads], dtype=torch.bool).reshape(-1, 2)
        self.starts = torch.tensor([0] + [h[2] for h in heads], dtype=torch.long).cumsum(0)
        place, wanted = os.path.join(folder, split + ".arrays"), ARRAYS | (VOICES if voices else {})
        known = self._known(place, heads)
        if missing := [name for name in wanted if name not in known]:
            self._make(place, heads, missing, known, workers)
        self.arrays = {name: torch.from_numpy(np.load(os.path.join(place, name + ".npy"), mmap_mode="c")) for name in wanted} if heads else {}

    def __len__(self):
        return len(self.names)

    def __getattr__(self, name):
        try:
            return self.__dict__["arrays"][name]
        except KeyError:
            raise AttributeError(name) from None

    @staticmethod
    def _known(place, heads):
        index = os.path.join(place, "index.json")
        if not os.path.exists(index):
            return []
        with open(index) as f:
            state = json.load(f)
        return state["arrays"] if state["clips"] == heads else []

    def _make(self, place, heads, names, known, workers):
        if not heads:
            return
        made = f"{place}.{os.getpid()}"
        os.makedirs(made)
        for name in names:
            shape, kind = (ARRAYS | VOICES)[name]
            np.lib.format.open_memmap(os.path.join(made, name + ".npy"), "w+", kind, (int(self.starts[-1]), *shape))
        jobs = [(p, made, int(at), names) for p, at in zip(self.paths, self.starts)]
        if workers == 1:
            list(map(_fill, jobs))
        else:
            with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
                list(pool.map(_fill, jobs, chunksize=4))
        if not known:
            shutil.rmtree(place, ignore_errors=True)
        os.makedirs(place, exist_ok=True)
        for name in names:
            os.replace(os.path.join(made, name + ".npy"), os.path.join(place, name + ".npy"))
        os.rmdir(made)
        with open(os.path.join(place, "index.json.tmp"), "w") as f:
            json.dump({"arrays": [*known, *names], "clips": heads}, f)
        os.replace(os.path.join(place, "index.json.tmp"), os.path.join(place, "index.json"))


class Motions:
    """Windows of a split's poses. `captured`: how much more often captured takes are drawn than their length says; `limit`: the first clips only; `form`: of
    what is drawn."""

    def __init__(self, folder, split, limit=None, captured=1.0, device="cpu", workers=1, form=ICOSAHEDRA):
        clips = Split(folder, split, workers=workers)
        self.size, self.device, self.form = min(len(clips), limit or len(clips)), torch.device(device), form
        self.starts, self.lengths = clips.starts[:self.size], clips.starts.diff()[:self.size]
        self.weights = self.lengths * torch.where(clips.talk[:self.size], 1.0, captured)
        self.frames = clips.frames.to(self.device) if self.size else None

    def sample(self, batch, frames):
        """Random windows [batch, frames, F] in metres."""
        long = (self.lengths >= frames).float()
        clip = torch.multinomial(self.weights * long, batch, replacement=True)
        at = (torch.rand(batch, dtype=torch.float64) * (self.lengths[clip] - frames + 1)).long()
        index = (self.starts[clip] + at)[:, None] + torch.arange(frames)
        return self.form.of(self.frames[index.to(self.device)])


class Several:
    """Motions of several corpora, as many windows of each."""

    def __init__(self, motions):
        self.motions = motions

    def sample(self, batch, frames):
        n = len(self.motions)
        parts = [m.sample((batch + n - 1 - i) // n, frames) for i, m in enumerate(self.motions) if batch > i]
        return torch.cat(parts)


def statistics(motions, stride=9, most=250000):
    """Mean and deviation per channel, and the frames they are of; a joint's channels share one deviation, at least 0.02 (m). The first frame of
    a clip, whose root has no displacement, is left out."""
    index = torch.cat([torch.arange(int(a) + 1, int(a + n), stride) for a, n in zip(motions.starts, motions.lengths)])
    form = motions.form
    x = form.of(motions.frames[index[:: 1 + len(index) // most].to(motions.device)])
    mean, std, end = x.mean(0), x.std(0), x.shape[1] - form.tail
    joints = x[:, 3:end].unflatten(-1, (-1, form.size)).var(0).mean(-1).sqrt().clamp(min=0.02)
    std = torch.cat([std[:3].clamp(min=1e-3), joints.repeat_interleave(form.size), std[end:].clamp(min=0.02)])
    return mean, std, x


def main():
    parser = argparse.ArgumentParser(description="Makes the arrays of a corpus that training reads.")
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--workers", type=int, default=1)
    args = parser.parse_args()
    for split in ("train", "val"):
        clips = Split(args.corpus, split, voices=True, workers=args.workers)
        print(f"{split}: {len(clips)} clips, {int(clips.starts[-1]) / 108000:.2f} hours")


if __name__ == "__main__":
    main()
