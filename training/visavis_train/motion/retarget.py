"""Motion files of the CMU, FreeMoCap, ACCAD and Biped skeletons -> the 22-joint rig at 30 fps.

Each target joint takes its source joint's global rotation relative to the source's rest pose, then an alignment
A_j that maps the target's rest bone direction to the source's, so that a differing rest pose (splayed legs,
drooping arms) does not turn limbs: R_tgt = R_src(t) R_src(rest)^T A_j. Positions come from FK on the rig.
"""
import os
from dataclasses import dataclass, field

import numpy as np

from . import rig
from .bvh import Clip, read_bvh, read_expmap
from .npz import read_npz
from .rig import INDEX, J, NAMES, OFFSETS

CMU_UNIT = 0.05644  # metres per unit of the 31-joint files


def _arms_legs(arm, leg):
    out = {}
    for side, tag in (("left", "L"), ("right", "R")):
        for name, src in zip(("Shoulder", "UpperArm", "LowerArm", "Hand"), arm):
            out[side + name] = src(tag)
        for name, src in zip(("UpperLeg", "LowerLeg", "Foot", "Toes"), leg):
            out[side + name] = src(tag)
    return out


def _word(fmt):
    return lambda tag: fmt.format(w={"L": "Left", "R": "Right"}[tag], l=tag.lower(), u=tag)


MAPS = {
    "cmu31": {"hips": "Hips", "spine": "LowerBack", "chest": "Spine", "upperChest": "Spine1", "neck": "Neck1", "head": "Head",
              **_arms_legs([_word("{w}Shoulder"), _word("{w}Arm"), _word("{w}ForeArm"), _word("{w}Hand")],
                           [_word("{w}UpLeg"), _word("{w}Leg"), _word("{w}Foot"), _word("{w}ToeBase")])},
    "cmu131": {"hips": "Hips", "spine": "lowerback", "chest": "Chest", "upperChest": "Chest2", "neck": "Neck", "head": "Head",
               **_arms_legs([_word("{w}Collar"), _word("{w}Shoulder"), _word("{w}Elbow"), _word("{w}Wrist")],
                            [_word("{w}Hip"), _word("{w}Knee"), _word("{w}Ankle"), _word("{w}Toe")])},
    "daz43": {"hips": "hip", "spine": "abdomen", "chest": "chest", "upperChest": "chest", "neck": "neck", "head": "head",
              **_arms_legs([_word("{l}Collar"), _word("{l}Shldr"), _word("{l}ForeArm"), _word("{l}Hand")],
                           [_word("{l}Thigh"), _word("{l}Shin"), _word("{l}Foot"), _word("{l}Foot")])},
    "cc100": {"hips": "CC_Base_Hip", "spine": "CC_Base_Waist", "chest": "CC_Base_Spine01", "upperChest": "CC_Base_Spine02",
              "neck": "CC_Base_NeckTwist01", "head": "CC_Base_Head",
              **_arms_legs([_word("CC_Base_{u}_Clavicle"), _word("CC_Base_{u}_Upperarm"), _word("CC_Base_{u}_Forearm"), _word("CC_Base_{u}_Hand")],
                           [_word("CC_Base_{u}_Thigh"), _word("CC_Base_{u}_Calf"), _word("CC_Base_{u}_Foot"), _word("CC_Base_{u}_ToeBase")])},
    "freemocap": {"hips": "pelvis", "spine": "spine", "chest": "spine.001", "upperChest": "spine.001", "neck": "neck", "head": "face",
                  **_arms_legs([_word("shoulder.{u}"), _word("upper_arm.{u}"), _word("forearm.{u}"), _word("forearm.{u}_End")],
                               [_word("thigh.{u}"), _word("shin.{u}"), _word("foot.{u}"), _word("foot.{u}_End")])},
    "accad": {"hips": "Hips", "spine": "ToSpine", "chest": "Spine", "upperChest": "Spine1", "neck": "Neck", "head": "Head",
              **_arms_legs([_word("{w}Shoulder"), _word("{w}Arm"), _word("{w}ForeArm"), _word("{w}Hand")],
                           [_word("{w}UpLeg"), _word("{w}Leg"), _word("{w}Foot"), _word("{w}ToeBase")])},
    "biped": {"hips": "Bip01 Pelvis", "spine": "Bip01 Spine", "chest": "Bip01 Spine1", "upperChest": "Bip01 Spine2", "neck": "Bip01 Neck",
              "head": "Bip01 Head",
              **_arms_legs([_word("Bip01 {u} Clavicle"), _word("Bip01 {u} UpperArm"), _word("Bip01 {u} Forearm"), _word("Bip01 {u} Hand")],
                           [_word("Bip01 {u} Thigh"), _word("Bip01 {u} Calf"), _word("Bip01 {u} Foot"), _word("Bip01 {u} Toe0")])},
}
# A Biped's axes run along its bones, so its rest pose is no zero pose: it is this frame of this take, a T-pose
BIPED_REST = ("movebox_conversation.npz", 30)
_BONE_CHILD = {"UpperArm": "LowerArm", "LowerArm": "Hand", "UpperLeg": "LowerLeg", "LowerLeg": "Foot"}


@dataclass
class Take:
    """A retargeted take: positions [T, 22, 3], rotations [T, 22, 3, 3] (global), 30 fps, floor at y = 0."""
    name: str
    positions: np.ndarray
    rotations: np.ndarray
    notes: list = field(default_factory=list)


def skeleton_kind(names):
    for kind, table in MAPS.items():
        if set(table.values()) <= set(names):
            return kind
    raise ValueError("unknown skeleton: none of the known joint naming schemes fits; add a table to retarget.MAPS")


def _rest(clip, kind, rest=None):
    """Rest rotations [N, 3, 3] and positions [N, 3], facing +Z: those of the clip `rest`, the first row (cmu31) or the zero pose."""
    sk = clip.skeleton
    n = len(sk.names)
    if rest is not None:
        at = [rest.skeleton.names.index(name) for name in MAPS[kind].values()]
        pos, rot = rest.fk()
        src = [sk.names.index(name) for name in MAPS[kind].values()]
        left, right = (rest.skeleton.names.index(MAPS[kind][side + "UpperArm"]) for side in ("left", "right"))
        across = pos[0, left] - pos[0, right]
        turn = rig.axis_mat("y", np.arctan2(across[2], across[0]))
        out_rot, out_pos = np.broadcast_to(np.eye(3), (n, 3, 3)).copy(), np.zeros((n, 3))
        out_rot[src], out_pos[src] = turn @ rot[0, at], pos[0, at] @ turn.T
        return out_rot, out_pos
    if kind == "cmu31":
        local = clip.local[:1]
    else:
        local = np.broadcast_to(np.eye(3), (1, n, 3, 3)).copy()
    pos, rot = type(clip)(sk, np.zeros((1, 3)), local, clip.dt).fk()
    return rot[0], pos[0]


def _deglitch(root, dt, limit=4.0):
    """Removes jumps: frames whose step exceeds `limit` m/s have the step replaced by its neighbours' mean."""
    step = np.diff(root, axis=0)
    bad = np.linalg.norm(step, axis=1) / dt > limit
    if not bad.any():
        return root, 0
    good = np.flatnonzero(~bad)
    fixed = np.stack([np.interp(np.arange(len(step)), good, step[good, c]) for c in range(3)], 1)
    # single-frame spikes go out and back: both steps are bad and cancel; a lasting offset is removed with them
    return np.concatenate([root[:1], root[0] + np.cumsum(fixed, axis=0)]), int(bad.sum())


def resample(quats, root, dt, fps=rig.FPS):
    """Linear (root) and normalised-linear (quaternions [T, J, 4]) resampling; low-passes first by box averaging."""
    k = max(1, int(round(1 / (dt * fps))))
    quats = rig.continuous_quats(quats)
    if k > 1:
        kernel = np.ones(k) / k
        flat = quats.reshape(len(quats), -1)
        pad = k // 2
        flat = np.pad(flat, ((pad, k - 1 - pad), (0, 0)), mode="edge")
        csum = np.cumsum(np.concatenate([np.zeros((1, flat.shape[1])), flat]), axis=0)
        quats = ((csum[k:] - csum[:-k]) / k).reshape(quats.shape)
        r = np.pad(root, ((pad, k - 1 - pad), (0, 0)), mode="edge")
        root = np.stack([np.convolve(r[:, c], kernel, "valid") for c in range(3)], 1)
    t = np.arange(0, (len(root) - 1) * dt + 1e-9, 1 / fps) / dt
    i = np.minimum(t.astype(int), len(root) - 2)
    f = t - i
    root = root[i] * (1 - f)[:, None] + root[i + 1] * f[:, None]
    q = quats[i] * (1 - f)[:, None, None] + quats[i + 1] * f[:, None, None]
    return q / np.linalg.norm(q, axis=-1, keepdims=True), root


def retarget(clip, dt, unit, drop_first=True, name="", scale=None, rest=None):
    """Clip -> Take. `dt`: the *true* frame time; `unit`: metres per file unit; `scale`: root scale (default leg ratio);
    `rest`: a clip whose first frame is the T-pose, for skeletons whose zero pose is none."""
    kind = skeleton_kind(clip.skeleton.names)
    table = MAPS[kind]
    src = [clip.skeleton.names.index(table[n]) for n in NAMES]
    rest_rot, rest_pos = _rest(clip, kind, rest)
    pos, rot = clip.fk()
    if drop_first:
        pos, rot = pos[1:], rot[1:]
    out = np.empty((len(rot), J, 3, 3))
    for j, n in enumerate(NAMES):
        g = rot[:, src[j]] @ rest_rot[src[j]].T
        for stem, child in _BONE_CHILD.items():
            if n.endswith(stem):
                c = INDEX[n.replace(stem, child)]
                a = rig.unit(OFFSETS[c])
                b = rig.unit(rest_pos[src[c]] - rest_pos[src[j]])
                g = g @ rig.between(a[None], b[None])[0]
        out[:, j] = g
    if kind in ("daz43", "freemocap"):  # one chest joint: spread abdomen..chest over spine, chest, upperChest
        q = rig.mat_to_quat(out[:, [INDEX["spine"], INDEX["upperChest"]]])
        a, b = q[:, 0], q[:, 1] * np.where(np.sum(q[:, 0] * q[:, 1], -1) < 0, -1, 1)[:, None]
        out[:, INDEX["chest"]] = rig.quat_to_mat(a + b)
    root = pos[:, src[0]] * unit
    root, jumps = _deglitch(root, dt)
    if scale is None:
        leg = sum(np.linalg.norm(rest_pos[src[INDEX[c]]] - rest_pos[src[INDEX[p]]])
                  for p, c in (("leftUpperLeg", "leftLowerLeg"), ("leftLowerLeg", "leftFoot"))) * unit
        scale = 0.805 / leg
    quats, root = resample(rig.mat_to_quat(out), root * scale, dt)
    rots = rig.quat_to_mat(quats)
    p = rig.fk_global(root, rots)
    # The skeletons differ in where the hips sit above the leg roots: put the lower foot on the floor
    low = np.minimum(p[:, INDEX["leftFoot"], 1], p[:, INDEX["rightFoot"], 1])
    p[..., 1] += rig.ANKLE_HEIGHT - np.percentile(low, 20)
    p[..., 1] += np.maximum(0, -np.percentile(p[:, [INDEX["leftToes"], INDEX["rightToes"]], 1].min(1), 2))
    return Take(name, p, rots, [f"{jumps} root jumps removed"] if jumps else [])


def load_take(path, name, cmu_skeleton=None):
    """Reads and retargets one file of the shared data by the rules of its README (true rates, units)."""
    if path.endswith(".txt"):
        return retarget(read_expmap(path, cmu_skeleton), 1 / 120, CMU_UNIT, True, name)
    if path.endswith(".npz"):
        clip = read_npz(path)
        if skeleton_kind(clip.skeleton.names) != "biped":
            return retarget(clip, clip.dt, 1.0, False, name)
        t = read_npz(os.path.join(os.path.dirname(path), BIPED_REST[0]))
        rest = Clip(t.skeleton, t.root[BIPED_REST[1]:][:1], t.local[BIPED_REST[1]:][:1], t.dt)
        return retarget(clip, clip.dt, 1.0, False, name, rest=rest)
    clip = read_bvh(path)
    kind = skeleton_kind(clip.skeleton.names)
    if kind == "daz43":
        two = name[:3] in ("60_", "61_")
        return retarget(clip, 1 / 60 if two else 1 / 120, 0.01, True, name, 1.05 if two else None)
    if kind == "cmu31":
        return retarget(clip, 1 / 120, CMU_UNIT, True, name)
    return retarget(clip, clip.dt, CMU_UNIT if kind == "cmu131" else 0.01, False, name)
