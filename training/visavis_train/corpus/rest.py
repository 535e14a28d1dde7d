"""The standing and arm-rest layers: how real people stand, shift their weight, fold their arms and keep still.

A recording is taken apart into what a composed body needs: the hips over the feet, pelvis, chest, head and collar bones
relative to where the feet point, wrists and elbows relative to the shoulders. Layers of several recordings follow each
other in a clip; they change over where the two bodies are alike, as slowly as their distance asks.
"""
import os
from dataclasses import dataclass, fields, replace

import numpy as np

from ..motion import rig
from ..motion.contacts import LEGS, lock_feet
from ..motion.retarget import load_take
from ..motion.rig import INDEX, OFFSETS
from .signals import FPS, gaussian, minjerk

ARMS = (("leftShoulder", "leftUpperArm", "leftLowerArm", "leftHand"), ("rightShoulder", "rightUpperArm", "rightLowerArm", "rightHand"))
LEG_REACH = 0.8022
TWIST, FLEX = 0.15, 0.10         # of a resting hand about the forearm and at the wrist [rad]
# Recordings by split; a person is in one split only. The number is how often one is drawn: in train so that the time that
# is drawn of each makes the mean of the people who did not act (least squares on what each alone gives, near equal times).
TAKES = {
    "train": {"reactidle/000_genuine": 0.155, "reactidle/002_genuine": 0.36, "reactidle/003_genuine": 0.14, "reactidle/007_genuine": 0.11,
              "reactidle/010_genuine": 0.45, "reactidle/015_genuine": 0.33, "reactidle/001_acted": 0.06, "reactidle/002_acted": 0.03,
              "reactidle/003_acted": 0.07, "reactidle/004_acted": 0.07, "reactidle/007_acted": 0.14, "reactidle/010_acted": 0.14,
              "accad_female1/Female1_A04_Look": 0.70, "rocketbox/f_idle_neutral_01": 0.18},
    "val": {"reactidle/011_genuine": 1.0, "reactidle/011_acted": 0.5, "reactidle/013_acted": 0.2},
    "test": {"reactidle/008_genuine": 1.0, "reactidle/008_acted": 0.5, "reactidle/009_acted": 0.5},
}
# Ten recordings of people who stand about and do not act: the row that everything is compared with
REAL_ROW = [f"reactidle/{n}_genuine" for n in ("000", "002", "003", "007", "008", "010", "011", "015")] \
    + ["accad_female1/Female1_A04_Look", "rocketbox/f_idle_neutral_01"]


# joint: lies between these two, by this share
SPINE = (("spine", "hips", "upperChest", 0.33), ("chest", "hips", "upperChest", 0.68), ("neck", "upperChest", "head", 0.45))


def between(a, b, w):
    """Normalised-linear blend of rotation matrices [T, 3, 3]; w scalar or [T]."""
    qa, qb = rig.mat_to_quat(a), rig.mat_to_quat(b)
    qb = qb * np.where(np.sum(qa * qb, -1) < 0, -1.0, 1.0)[:, None]
    w = np.broadcast_to(np.asarray(w, float), qa.shape[:1])[:, None]
    return rig.quat_to_mat(qa * (1 - w) + qb * w)


@dataclass
class Rest:
    """Layers of a body at rest, T frames; sides 0 left, 1 right, right ones mirrored to the left."""
    hips: np.ndarray      # [T, 3] left and ahead of the ankles' middle [m], and how far below straight legs
    pelvis: np.ndarray    # [T, 3] rotation vector relative to the heading
    chest: np.ndarray     # [T, 3] likewise, upper chest
    spine: np.ndarray     # [T, 3, 3] of spine, chest, neck: rotation vector from where `SPINE` puts them between their neighbours
    head: np.ndarray      # [T, 3] yaw, pitch, roll relative to the heading, about their medians
    shoulder: np.ndarray  # [T, 2, 3] rotation vector of the collar bone in the chest's frame
    wrist: np.ndarray     # [T, 2, 3] relative to the shoulder joint in the chest's frame
    elbow: np.ndarray     # [T, 2, 3] unit vector from the shoulder-wrist line to the elbow, same frame

    def __len__(self):
        return len(self.hips)

    def cut(self, a, b):
        return Rest(**{f.name: getattr(self, f.name)[a:b] for f in fields(self)})

    def mirror(self):
        """The same as seen in a mirror: rotation vectors are axial, offsets polar."""
        flip = np.array([1.0, -1, -1])
        return replace(self, hips=self.hips * [-1, 1, 1], pelvis=self.pelvis * flip, chest=self.chest * flip, spine=self.spine * flip, head=self.head * [-1, 1, -1],
                       shoulder=self.shoulder[:, ::-1], wrist=self.wrist[:, ::-1], elbow=self.elbow[:, ::-1])


def heading(rotations):
    """Slow yaw of the hips [T]: where a standing body points, its fast turns left out."""
    return gaussian(np.unwrap(rig.yaw_of(rotations[:, 0])), 3.0 * FPS)


def legs_height(hips_xz, rot, ankles):
    """Greatest height [T] at which both legs reach their ankles [T, 2, 3]."""
    height = np.full(len(rot), 9.0)
    for s, names in enumerate(LEGS):
        off = rot @ OFFSETS[INDEX[names[0]]]
        d = ankles[:, s, [0, 2]] - hips_xz - off[:, [0, 2]]
        height = np.minimum(height, ankles[:, s, 1] - off[:, 1] + np.sqrt(np.maximum(LEG_REACH ** 2 - (d * d).sum(1), 0.30)))
    return height


def arm_layers(positions, rotations):
    """Collar bones, wrists and elbow directions [T, 2, 3] of a body, right side mirrored."""
    chest = rotations[:, INDEX["upperChest"]]
    turn = np.swapaxes(chest, -1, -2)
    shoulder, wrist, elbow = [], [], []
    for s, (collar, upper, lower, hand) in enumerate(ARMS):
        polar = np.array([1.0 if s == 0 else -1.0, 1, 1])
        shoulder.append(rig.mat_to_rotvec(turn @ rotations[:, INDEX[collar]]) * (1 if s == 0 else np.array([1, -1, -1])))
        to = lambda j: np.einsum("tab,tb->ta", turn, positions[:, INDEX[j]] - positions[:, INDEX[upper]]) * polar
        w, e = to(hand), to(lower)
        line = rig.unit(w)
        out = e - np.sum(e * line, -1, keepdims=True) * line
        # a straight arm's elbow points nowhere: there a hanging arm's, backwards and a little outwards, takes over
        usual = np.array([0.3, 0.0, -0.95]) - np.sum(line * [0.3, 0.0, -0.95], -1, keepdims=True) * line
        wrist.append(w), elbow.append(rig.unit(gaussian(out + 0.02 * usual, 3.0)))
    return tuple(np.stack(x, 1) for x in (shoulder, wrist, elbow))


def clear_trunk(wrist):
    """Wrists [T, 2, 3] pushed forwards out of the trunk (retargeted arms are of another length), as softly as they go in."""
    w = wrist.copy()
    x = w[..., 0] + 0.17
    front = 0.125 * np.sqrt(np.clip(1 - (x / 0.165) ** 2, 0, 1)) + 0.01
    beside = np.clip((w[..., 1] + 0.50) / 0.08, 0, 1)              # below the hips nothing is in the way
    short = np.maximum(front - w[..., 2], 0) * beside * np.clip((w[..., 2] + 0.05) / 0.08, 0, 1)
    w[..., 2] += gaussian(short, 3.0)
    return w


def angles(m):
    """Yaw, pitch (down positive) and roll [T, 3] of rotations [T, 3, 3]."""
    return np.stack([rig.yaw_of(m), np.arctan2(-m[:, 1, 2], np.hypot(m[:, 0, 2], m[:, 2, 2])), np.arctan2(m[:, 1, 0], m[:, 1, 1])], 1)


def layers(positions, rotations):
    """A retargeted recording -> Rest."""
    p, r = lock_feet(positions, rotations)
    yaw = heading(r)
    turn = rig.axis_mat("y", -yaw)
    ankles = p[:, [INDEX["leftFoot"], INDEX["rightFoot"]]]
    over = np.einsum("tab,tb->ta", turn, p[:, 0] - gaussian(ankles.mean(1), 4.0))
    bend = np.clip(gaussian(legs_height(p[:, 0][:, [0, 2]], r[:, 0], ankles) - p[:, 0, 1], 3.0), 0.0, 0.05)
    vec = lambda j: rig.mat_to_rotvec(turn @ r[:, INDEX[j]])
    h = turn @ r[:, INDEX["head"]]
    head = angles(h)
    pelvis, chest = vec("hips"), vec("upperChest")
    # captures differ in what they call upright: a recording's own median stands for it, near the usual lean
    pelvis, chest = pelvis - np.median(pelvis, 0) + [0.02, 0, 0], chest - np.median(chest, 0) + [0.02, 0, 0]
    over = over - np.median(over, 0) + [0, 0, 0.035]
    spine = np.stack([rig.mat_to_rotvec(np.swapaxes(between(r[:, INDEX[a]], r[:, INDEX[b]], w), -1, -2) @ r[:, INDEX[j]]) for j, a, b, w in SPINE], 1)
    shoulder, wrist, elbow = arm_layers(p, r)
    smooth = lambda x: gaussian(x, 1.0)
    hips = np.stack([0.10 * np.tanh(over[:, 0] / 0.10), 0.035 + 0.08 * np.tanh((over[:, 2] - 0.035) / 0.08), bend], 1)
    return Rest(smooth(hips), smooth(pelvis), smooth(chest), smooth(spine - np.median(spine, 0)), smooth(head - np.median(head, 0)), smooth(shoulder), smooth(clear_trunk(wrist)), elbow)


def take(data, name):
    """One recording, retargeted."""
    path = os.path.join(data, "motion", name + ".npz")
    if not os.path.exists(path):
        raise FileNotFoundError(f"{path}: the corpus needs this recording of people at rest; see training/README.md for the data")
    t = load_take(path, name)
    if name.startswith("reactidle/"):
        level_head(t.rotations)
    return t


def level_head(rotations, pitch=0.05):
    """Turns the head, in its own frame, by one rotation, so that its median looks ahead [rad, down positive] and stands upright:
    where the face of a markerless capture points is not to be trusted, how it moves is."""
    h = rig.axis_mat("y", -heading(rotations)) @ rotations[:, INDEX["head"]]
    down, tilt = np.median(angles(h)[:, 1:], 0)
    rotations[:, INDEX["head"]] = rotations[:, INDEX["head"]] @ rig.axis_mat("z", -tilt) @ rig.axis_mat("x", pitch - down)


def dressed(positions, rotations):
    """The body with arms whose twist is made up as for composed ones (the recordings have none worth using)."""
    from .body import pose_arm
    g = rotations.copy()
    chest = g[:, INDEX["upperChest"]]
    shoulder, wrist, elbow = arm_layers(positions, rotations)
    wrist = clear_trunk(wrist)
    for s in (0, 1):
        polar, axial = (1.0, 1.0) if s == 0 else (np.array([-1.0, 1, 1]), np.array([1.0, -1, -1]))
        zero = np.zeros(len(g))
        pose_arm(g, s, chest, shoulder[:, s] * axial, wrist[:, s] * polar, elbow[:, s] * polar, zero + TWIST, zero + FLEX)
    return rig.fk_global(positions[:, 0], g), g


@dataclass
class Library:
    """Recordings of a split with the weight of each, each followed by its mirror image."""
    names: list
    rests: list
    weights: np.ndarray


def load(data, split):
    names, rests, weights = [], [], []
    for name, weight in TAKES[split].items():
        t = take(data, name)
        one = layers(t.positions, t.rotations)
        names += [name, name + "_mirror"]
        rests += [one, one.mirror()]
        weights += [weight, weight]
    return Library(names, rests, np.array(weights))


def _pose(rest):
    """What tells two bodies at rest apart [T, 15], in metres: wrists, chest, hips and a little of where the head looks."""
    return np.concatenate([rest.wrist.reshape(len(rest), 6), 0.4 * rest.chest, rest.hips, 0.06 * rest.head], 1)


def _unrest(rest):
    """Mean speed [T] of the pose over the second from each frame on."""
    v = np.linalg.norm(np.diff(_pose(rest), axis=0, append=_pose(rest)[-1:]), axis=1) * FPS
    c = np.concatenate([[0], np.cumsum(v), np.full(FPS, v.sum())])
    return (c[FPS: FPS + len(v)] - c[:len(v)]) / FPS


PEAK = 5.77       # peak acceleration of a minimum-jerk movement of length d in time T: 5.77 d / T^2
ENTRY = 15 * FPS  # of a recording is looked through for the best place to enter it
GENTLE = 0.20     # acceleration [m/s2] that a change-over may add at its peak


def _blend(a, b, m):
    """Layers a to b by m [T] in 0..1."""
    out = {}
    for f in fields(a):
        x, y = getattr(a, f.name), getattr(b, f.name)
        out[f.name] = x + (y - x) * m.reshape((-1,) + (1,) * (x.ndim - 1))
    out["elbow"] = rig.unit(out["elbow"])
    return Rest(**out)


def _join(rng, rest, spots, other):
    """(cost, spot, start, frames): the frame of `spots` and the one of `other` at which a change-over shows least, and over
    how many frames; both bodies alike and calm. A long recording is entered anywhere, a short one early."""
    last = max(1, len(other) - (12 * FPS if len(other) > 40 * FPS else int(0.8 * len(other))))
    first = int(rng.integers(0, max(1, last - ENTRY)))         # a random stretch, so that all of a recording comes to be seen
    pose, calm = _pose(other)[first:last][:ENTRY], _unrest(other)[first:last][:ENTRY]
    d = np.linalg.norm(pose[None] - _pose(rest)[spots][:, None], axis=2) + 1.0 * (calm[None] + _unrest(rest)[spots][:, None])
    i, k = np.unravel_index(int((d + 0.03 * rng.random(d.shape)).argmin()), d.shape)
    cost, k = d[i, k], k + first
    reach = np.linalg.norm(other.wrist[k] - rest.wrist[spots[i]], axis=-1).max()
    return cost, int(spots[i]), int(k), int(FPS * np.clip(np.sqrt(PEAK * reach / GENTLE), 1.8, 5.0))


GOLDEN = 0.6180339887    # multiples of it, modulo 1, fill 0..1 evenly


def compose(rng, library, frames, quantile=None):
    """Rest of `frames` frames from the library, the change-overs [(start, end)] and the names of what was used.

    `quantile`: which recording comes first, 0..1 of the weights in their order, at random if None; those that follow are
    spread evenly from there, so that few clips suffice to draw each by its weight."""
    edges = np.cumsum(library.weights / library.weights.sum())
    quantile = rng.random() if quantile is None else quantile
    pick = lambda i: int(min(np.searchsorted(edges, (quantile + i * GOLDEN) % 1.0), len(edges) - 1))
    k = pick(0)
    used, rest = [library.names[k]], library.rests[k]
    at = int(rng.integers(0, max(1, len(rest) - 20 * FPS)))
    parts, joins, n = [], [], 0
    while n + len(rest) - at < frames:
        # the next one, as it is or mirrored: whichever has the pose nearest to one of the last seconds of this one
        k = pick(len(used)) // 2 * 2
        end = max(at + 1, len(rest) - 5 * FPS)
        spots = np.unique(rng.integers(max(at, end - min(10 * FPS, len(rest) // 5)), end, 12))
        _, spot, start, span, k = min(_join(rng, rest, spots, library.rests[j]) + (j,) for j in (k, k + 1))
        other = library.rests[k]
        span = max(2, min(span, len(rest) - spot, len(other) - start))
        parts += [rest.cut(at, spot), _blend(rest.cut(spot, spot + span), other.cut(start, start + span), minjerk((np.arange(span) + 1) / (span + 1)))]
        n += spot - at
        joins.append((min(n, frames), min(n + span, frames)))
        n += span
        rest, at = other, start + span
        used.append(library.names[k])
    parts.append(rest.cut(at, at + max(frames - n, 0)))
    whole = Rest(**{f.name: np.concatenate([getattr(p, f.name) for p in parts])[:frames] for f in fields(rest)})
    return whole, [(a, b) for a, b in joins if b > a], used
