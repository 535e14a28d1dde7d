"""Corpus clips as training arrays.

A frame is kept compactly as (vx, vz, dyaw), then position and rotation matrix of each joint in the heading frame: 3 + 12 J
numbers, which `expand` turns into the 3 + 36 J of a feature vector. A corpus is DIR/{train,val,test}/*.safetensors in the
format of `corpus/store.py`; one's own captures come in the same format.
"""
import os

import numpy as np
import torch

from ..corpus import store
from ..motion import rig
from ..motion.features import ICO, RADIUS, root_of

ICO_T = torch.tensor(ICO, dtype=torch.float32)


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


def expand(c):
    """Compact frames [..., 3 + 12 J] -> feature vectors [..., 3 + 36 J], metres."""
    joints = (c.shape[-1] - 3) // 12
    p = c[..., 3:3 + 3 * joints].unflatten(-1, (joints, 1, 3))
    r = c[..., 3 + 3 * joints:].unflatten(-1, (joints, 3, 3))
    verts = p + RADIUS * torch.einsum("...jab,vb->...jva", r, ICO_T)
    return torch.cat([c[..., :3], verts.flatten(-3)], -1)


def load_motion(path, voices=True):
    """One clip: its store.Clip, compact frames, roots [T, 3] and gaze score [T]."""
    clip = store.load(path, voices)
    frames, roots = compact(clip.positions, clip.rotations)
    g = rig.gaze_score(clip.positions.astype(np.float64), rig.quat_to_mat(clip.rotations), clip.user_head)
    return clip, torch.from_numpy(frames), torch.from_numpy(roots), torch.from_numpy(g.astype(np.float32))


def clips(folder, split):
    return store.list_clips(folder, split) if os.path.isdir(os.path.join(folder, split)) else []


class Motions:
    """Compact frames of all clips of a split. `captured`: how much more often captured takes are drawn than their length says.

    Poses are kept beside the split in one file (`SPLIT.motions.pt`), made anew when the clips change."""

    def __init__(self, folder, split, limit=None, captured=1.0):
        self.items, weights = [], []
        kept = os.path.join(folder, split + ".motions.pt")
        paths = clips(folder, split)[:limit]
        names = [(os.path.basename(p), os.path.getsize(p)) for p in paths]
        state = torch.load(kept, mmap=True) if os.path.exists(kept) else {}
        if state.get("names") == names:
            self.items = state["items"]
            self.weights = torch.tensor([len(f) * (1.0 if t else captured) for f, t in zip(self.items, state["talk"])])
            return
        talk = []
        for path in paths:
            clip = store.load(path, voices=False)
            frames = torch.from_numpy(compact(clip.positions, clip.rotations)[0])
            self.items.append(frames)
            talk.append(clip.meta.get("kind") == "talk")
            weights.append(len(frames) * (1.0 if talk[-1] else captured))
        self.weights = torch.tensor(weights)
        if limit is None and self.items:
            torch.save({"items": self.items, "talk": talk, "names": names}, f"{kept}.{os.getpid()}")
            os.replace(f"{kept}.{os.getpid()}", kept)

    def sample(self, batch, frames):
        """Random windows [batch, frames, F] in metres."""
        out = []
        long = torch.tensor([float(len(item) >= frames) for item in self.items])
        for i in torch.multinomial(self.weights * long, batch, replacement=True).tolist():
            item = self.items[i]
            at = int(torch.randint(0, len(item) - frames + 1, (1,)))
            out.append(item[at:at + frames])
        return expand(torch.stack(out))


def statistics(motions, stride=9):
    """Mean and deviation per channel; a joint's 36 channels share one deviation, at least 0.02 m."""
    x = expand(torch.cat([f[1::stride] for f in motions.items]))
    mean, std = x.mean(0), x.std(0)
    joints = x[:, 3:].unflatten(-1, (-1, 36)).var(0).mean(-1).sqrt().clamp(min=0.02)
    std = torch.cat([std[:3].clamp(min=1e-3), joints.repeat_interleave(36)])
    return mean, std, x
