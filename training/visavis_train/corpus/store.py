"""The clip format on disk: one `.safetensors` a clip; also the loader that training uses for one's own captures.

    positions   f32 [T, 22, 3]   global joint positions, metres, Y up, the agent's root at the origin facing +Z in frame 0
    rotations   f32 [T, 22, 4]   global quaternions (x, y, z, w), sign-continuous
    user_head   f32 [T, 3]       the user's head position
    user_head_rotation f32 [T, 4]  global quaternions of the user's head, the identity facing +Z; left out where unknown
    agent_voice i16 [800 T]      24 kHz mono; left out where absent
    user_voice  i16 [800 T]      likewise
metadata (strings): split, sources (JSON list), gaze_level, seed, kind, fps.
"""
import json
import os
from dataclasses import dataclass, field

import numpy as np
from safetensors import safe_open

from ..motion import rig


class ClipError(ValueError):
    """A clip file that does not follow the format; the message says what is wrong."""


@dataclass
class Clip:
    positions: np.ndarray
    rotations: np.ndarray
    user_head: np.ndarray
    agent_voice: np.ndarray = None
    user_voice: np.ndarray = None
    meta: dict = field(default_factory=dict)
    user_head_rotation: np.ndarray = None


def to_session(positions, rotmats, user):
    """Moves a clip so that the root of frame 0 lies at the origin facing +Z."""
    inv = rig.axis_mat("y", -rig.yaw_of(rotmats[0, 0]))
    origin = positions[0, 0] * [1, 0, 1]
    return (positions - origin) @ inv.T, inv @ rotmats, (user - origin) @ inv.T


def _pcm(voice):
    return np.clip(np.round(voice * 32767), -32768, 32767).astype(np.int16)


def save(path, positions, rotmats, user, agent_voice, user_voice, meta, user_rotmats=None):
    """Writes one clip; voices are float [800 T] or None; `user_rotmats` [T, 3, 3] or None: the user's head."""
    p, r, u = to_session(positions, rotmats, user)
    quats = lambda m: rig.continuous_quats(rig.mat_to_quat(m)).astype(np.float32)
    data = {"positions": p.astype(np.float32), "rotations": quats(r), "user_head": u.astype(np.float32)}
    if user_rotmats is not None:
        data["user_head_rotation"] = quats(rig.axis_mat("y", -rig.yaw_of(rotmats[0, 0])) @ user_rotmats)
    for key, voice in (("agent_voice", agent_voice), ("user_voice", user_voice)):
        if voice is not None:
            data[key] = _pcm(voice)
    meta = {k: v if isinstance(v, str) else json.dumps(v) for k, v in meta.items()}
    meta.setdefault("fps", str(rig.FPS))
    _write(path, data, meta)


def rewrite(path, clip):
    """Writes a clip that was loaded, as it is."""
    names = ("positions", "rotations", "user_head", "user_head_rotation", "agent_voice", "user_voice")
    _write(path, {k: v for k in names if (v := getattr(clip, k)) is not None}, clip.meta)


def _write(path, tensors, meta):
    """safetensors by hand: the library's writer orders metadata at random, and equal clips should be equal files."""
    header, at = {"__metadata__": dict(sorted(meta.items()))}, 0
    for k in sorted(tensors):
        v = tensors[k]
        header[k] = {"dtype": {"float32": "F32", "int16": "I16"}[v.dtype.name], "shape": list(v.shape), "data_offsets": [at, at + v.nbytes]}
        at += v.nbytes
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    with open(path, "wb") as f:
        f.write(len(text).to_bytes(8, "little") + text)
        for k in sorted(tensors):
            f.write(np.ascontiguousarray(tensors[k]).astype(tensors[k].dtype.newbyteorder("<"), copy=False).tobytes())


def load(path, voices=True):
    """Reads and checks one clip; `voices=False` leaves the voices on disk (absent in the result)."""
    with safe_open(path, framework="numpy") as f:
        keys, meta = set(f.keys()), f.metadata() or {}
        keys -= set() if voices else {"agent_voice", "user_voice"}
        missing = {"positions", "rotations", "user_head"} - keys
        if missing:
            raise ClipError(f"{path}: tensors {sorted(missing)} are missing; see visavis_train/corpus/store.py for the format")
        get = lambda k: f.get_tensor(k) if k in keys else None
        clip = Clip(*(get(k) for k in ("positions", "rotations", "user_head", "agent_voice", "user_voice")), meta, get("user_head_rotation"))
    t = len(clip.positions)
    want = {"positions": (t, rig.J, 3), "rotations": (t, rig.J, 4), "user_head": (t, 3)} | ({"user_head_rotation": (t, 4)} if clip.user_head_rotation is not None else {})
    for k, shape in want.items():
        if getattr(clip, k).shape != shape:
            raise ClipError(f"{path}: {k} is {list(getattr(clip, k).shape)}, expected {list(shape)}")
    for k in ("agent_voice", "user_voice"):
        v = getattr(clip, k)
        if v is not None and v.shape != (rig.SAMPLES_PER_FRAME * t,):
            raise ClipError(f"{path}: {k} has {v.size} samples, expected 800 x {t} frames at 24 kHz")
    return clip


def list_clips(folder, split):
    """Sorted clip paths of one split."""
    d = os.path.join(folder, split)
    return [os.path.join(d, f) for f in sorted(os.listdir(d)) if f.endswith(".safetensors")]
