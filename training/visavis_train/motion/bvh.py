"""Readers of motion files: BVH, and the exponential-map text of the `cmu_signals` takes."""
from dataclasses import dataclass

import numpy as np

from .rig import axis_mat, rotvec_to_mat


class MotionFormatError(ValueError):
    """A motion file that cannot be read; the message says where and what to do."""


@dataclass
class Skeleton:
    names: list      # joint names; end sites are "<parent>_end"
    parents: list    # parent index, -1 for the root
    offsets: np.ndarray  # [N, 3] in file units
    channels: list   # per joint: list of channel names


@dataclass
class Clip:
    skeleton: Skeleton
    root: np.ndarray   # [T, 3] root translation in file units
    local: np.ndarray  # [T, N, 3, 3] local rotations
    dt: float          # frame time in the header [s]; not to be trusted for every source

    def fk(self):
        """Global positions [T, N, 3] in file units and rotations [T, N, 3, 3]."""
        t, n = self.local.shape[:2]
        rot, pos = np.empty_like(self.local), np.empty((t, n, 3))
        for j, parent in enumerate(self.skeleton.parents):
            if parent < 0:
                rot[:, j] = self.local[:, j]
                pos[:, j] = self.root
            else:
                rot[:, j] = rot[:, parent] @ self.local[:, j]
                pos[:, j] = pos[:, parent] + rot[:, parent] @ self.skeleton.offsets[j]
        return pos, rot


def parse_hierarchy(text, where="BVH"):
    names, parents, offsets, channels, stack = [], [], [], [], []
    tokens = iter(text.split())
    last = None
    for tok in tokens:
        if tok in ("ROOT", "JOINT", "End"):
            name = next(tokens)
            if tok == "End":
                name = names[stack[-1]] + "_end"
            names.append(name)
            parents.append(stack[-1] if stack else -1)
            offsets.append(np.zeros(3))
            channels.append([])
            last = len(names) - 1
        elif tok == "{":
            stack.append(last)
        elif tok == "}":
            stack.pop()
        elif tok == "OFFSET":
            offsets[stack[-1]] = np.array([float(next(tokens)) for _ in range(3)])
        elif tok == "CHANNELS":
            channels[stack[-1]] = [next(tokens) for _ in range(int(next(tokens)))]
    if not names or stack:
        raise MotionFormatError(f"{where}: the HIERARCHY is empty or its braces do not match; export the file again")
    return Skeleton(names, parents, np.array(offsets), channels)


def parse_bvh(text, where="BVH"):
    """BVH text -> Clip. Rotations are composed in the order in which the channels are listed."""
    head, sep, motion = text.partition("MOTION")
    if not sep or "HIERARCHY" not in head:
        raise MotionFormatError(f"{where}: no HIERARCHY and MOTION sections; is this a BVH file?")
    sk = parse_hierarchy(head.split("HIERARCHY", 1)[1], where)
    lines = [l for l in motion.splitlines() if l.strip()]
    try:
        frames = int(lines[0].split(":")[1])
        dt = float(lines[1].split(":")[1])
    except (IndexError, ValueError) as e:
        raise MotionFormatError(f"{where}: 'Frames:' and 'Frame Time:' must follow MOTION") from e
    width = sum(len(c) for c in sk.channels)
    data = np.array(" ".join(lines[2:]).split(), dtype=np.float64)
    if data.size < frames * width:
        raise MotionFormatError(f"{where}: {data.size} numbers where {frames} frames of {width} channels are announced")
    data = data[: frames * width].reshape(frames, width)
    local = np.broadcast_to(np.eye(3), (frames, len(sk.names), 3, 3)).copy()
    root = np.zeros((frames, 3))
    at = 0
    for j, names in enumerate(sk.channels):
        for name in names:
            col = data[:, at]
            at += 1
            axis = name[0].lower()
            if name.endswith("position"):
                if sk.parents[j] < 0:
                    root[:, "xyz".index(axis)] = col
            else:
                local[:, j] = local[:, j] @ axis_mat(axis, np.radians(col))
    return Clip(sk, root + sk.offsets[0], local, dt)


def read_bvh(path):
    with open(path, encoding="utf-8", errors="replace") as f:
        return parse_bvh(f.read(), str(path))


def read_expmap(path, skeleton, dt=1 / 120):
    """Text of 3 + 3 N columns: root xyz and one exponential map per joint, end sites included, depth first.

    The maps are of the transposed (row-vector) rotations, hence the sign. `skeleton`: one of the same hierarchy.
    """
    rows = np.loadtxt(path, delimiter=",", ndmin=2)
    n = len(skeleton.names)
    if rows.shape[1] != 3 + 3 * n:
        raise MotionFormatError(f"{path}: {rows.shape[1]} columns, expected {3 + 3 * n} for {n} joints of this skeleton")
    return Clip(skeleton, rows[:, :3], rotvec_to_mat(-rows[:, 3:].reshape(len(rows), n, 3)), dt)
