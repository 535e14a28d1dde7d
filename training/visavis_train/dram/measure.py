"""Measures of the tier: errors of joint positions by group, Delta by what the user does, free-running motion."""
import numpy as np
import torch
from scipy.signal import butter, sosfiltfilt
from scipy.stats import ttest_rel

from ..corpus import measures
from ..motion import rig
from . import nets, pose, roll

FPS = rig.FPS
# groups of the paper's table: points of the rig
GROUPS = {"torso": ("spine", "chest", "upperChest"), "head": ("head", "eyes"), "neck": ("neck",), "right arm": ("rightUpperArm", "rightLowerArm"),
          "left arm": ("leftUpperArm", "leftLowerArm"), "right wrist": ("rightHand",), "left wrist": ("leftHand",)}
NAMES = [n for g in GROUPS.values() for n in g]
EYES = torch.tensor(rig.EYES, dtype=torch.float32)


def points(layout, y):
    """The table's twelve points [..., 12, 3] relative to the hips, metres, in the heading frame; y [..., D] of `layout`."""
    six = torch.zeros(*y.shape[:-1], rig.J, 6)
    six[..., 0] = six[..., 4] = 1
    six[..., list(layout.joints), :] = y[..., layout.lead:].unflatten(-1, (-1, 6))
    p, r = pose.kinematics(six)
    eyes = p[..., rig.INDEX["head"], :] + r[..., rig.INDEX["head"], :, :] @ EYES
    return torch.stack([eyes if n == "eyes" else p[..., rig.INDEX[n], :] for n in NAMES], -2)


def group_errors(error):
    """Distances [..., 12] -> [..., groups]."""
    at, out = 0, []
    for names in GROUPS.values():
        out.append(error[..., at:at + len(names)].mean(-1))
        at += len(names)
    return torch.stack(out, -1)


@torch.no_grad()
def position_errors(net, layout, data, windows, first=96, frames=128, batch=64):
    """Distances [windows, frames, 12] in cm between recorded points and those of roll-outs that begin after `first` recorded frames, and each window's clip."""
    places, out = data.spread(windows, first + frames), []
    for part in (places[i:i + batch] for i in range(0, len(places), batch)):
        w = data.at([c for c, _ in part], [a for _, a in part], first + frames)
        y = roll.free(net, w, layout, first, first + frames)[0]
        out.append((points(layout, y) - points(layout, layout.take(w.y[:, first:]))).norm(dim=-1) * 100)
    return torch.cat(out), np.array([c for c, _ in places])


def by_clip(values, clips):
    """Means [clips, ...] of windows' values."""
    return np.stack([values[clips == c].mean(0) for c in np.unique(clips)])


def paired(a, b):
    """Mean of a - b, its standard error, two-tailed p of the paired t-test."""
    d = a - b
    return float(d.mean()), float(d.std(ddof=1) / len(d) ** 0.5), float(ttest_rel(a, b).pvalue)


def held(mask, after):
    """A mask [B, T] and `after` frames behind each of its frames."""
    out = mask.clone()
    for k in range(1, after + 1):
        out[:, k:] |= mask[:, :-k]
    return out


def acts(window):
    """What the user does, as masks [B, T]: half a second behind is counted in, and the delay with which the model is told."""
    late = lambda m: held(torch.nn.functional.pad(m, (nets.DELAY, 0))[:, :m.shape[1]], FPS // 2)
    begins = torch.zeros_like(window.hears)
    begins[:, 1:] = window.hears[:, 1:] & ~window.hears[:, :-1] & window.speaks[:, 1:]
    interrupts = late(held(begins, FPS))
    moves = torch.zeros_like(window.hears)
    moves[:, 1:] = window.head.diff(dim=1).norm(dim=-1) * FPS > 0.3
    speaks, nods, moves = late(window.hears), late(window.nods), late(moves)
    return {"interrupts": interrupts, "nods": nods & ~moves, "speaks": speaks & ~moves, "moves about": moves, "silent and still": ~(interrupts | nods | speaks | moves)}


@torch.no_grad()
def deltas(net, layout, data, windows=96, frames=400, first=64, batch=32, own=False):
    """Mean Delta by act: {act: ([clips] mean over all joints, head and neck)} over clips that have the act and silence; teacher-forced, or free."""
    places, rows = data.spread(windows, frames), {}
    head = [layout.joints.index(rig.INDEX[n]) for n in ("neck", "head")]
    for part in (places[i:i + batch] for i in range(0, len(places), batch)):
        w = data.at([c for c, _ in part], [a for _, a in part], frames)
        if own:
            delta = roll.free(net, w, layout, first, frames)[1]
        else:
            delta = roll.forced(net, w, layout, 5, frames)[1][:, first - 5:]
        joints = layout.per_joint(delta)
        for name, mask in acts(w).items():
            for i, (c, _) in enumerate(part):
                if (m := mask[i, first:]).any():
                    rows.setdefault(name, {}).setdefault(c, []).append((int(m.sum()), joints[i][m].mean().item(), joints[i][m][:, head].mean().item()))
    total = lambda v: np.array([sum(n * x[i] for n, *x in v) / sum(n for n, *_ in v) for i in (0, 1)])
    return {name: {c: total(v) for c, v in of.items()} for name, of in rows.items()}


def body(y, roots):
    """Positions [B, T, J, 3] and rotation matrices in the world, float64."""
    p, r = pose.kinematics(y[..., pose.LEAD:].double().unflatten(-1, (-1, 6)), y[..., 3].double())
    turn = torch.from_numpy(rig.axis_mat("y", roots[..., 2].numpy()))[:, :, None]
    base = torch.stack([roots[..., 0], torch.zeros_like(roots[..., 0]), roots[..., 1]], -1)[:, :, None]
    return ((turn @ p[..., None])[..., 0] + base).numpy(), (turn @ r).numpy()


def nod_power(rotations, nods):
    """Pitch of the head in the band of nods (1 to 3.5 Hz), rms in degrees: in the 0.3 to 1.5 s behind the start of a user's nod, and elsewhere."""
    pitch = -np.arcsin(np.clip(rotations[..., rig.INDEX["head"], 1, 2], -1, 1))
    band = sosfiltfilt(butter(2, [1.0, 3.5], "band", fs=FPS, output="sos"), pitch, axis=-1)
    begins = np.zeros_like(nods)
    begins[:, 1:] = nods[:, 1:] & ~nods[:, :-1]
    near = np.zeros_like(nods)
    for b, t in zip(*np.nonzero(begins)):
        near[b, t + 9:t + 45] = True
    rms = lambda m: float(np.degrees(np.sqrt((band[m] ** 2).mean()))) if m.any() else float("nan")
    return rms(near), rms(~near)


def liveliness(y, roots, window, first):
    """Figures of motion y [B, T, D] of the whole body from frame `first` of a window on."""
    p, r = body(y, roots)
    tracks = [measures.tracks(a, b) for a, b in zip(p, r)]
    hand = np.stack([t["hand_v"] for t in tracks])[:, 5:-5]
    user, n = window.head[:, first:].numpy(), p.shape[1]
    talk = window.speaks[:, first:first + n].numpy()[:, 1:]
    gaze = np.stack([rig.gaze_score(a, b, u[:n]) for a, b, u in zip(p, r, user)])
    wrist = (np.linalg.norm(np.diff(p[:, :, measures.HANDS], axis=1), axis=-1) * FPS).mean(-1)
    foot, low = np.linalg.norm(np.diff(p[:, :, measures.ANKLES][..., [0, 2]], axis=1), axis=-1) * FPS, p[:, 1:, measures.ANKLES, 1] < 0.11
    near, else_ = nod_power(r, window.nods[:, first:first + n].numpy())
    return {"stillness": float((hand < measures.STILL).all(-1).mean()), "hand m/s": float(hand.mean()), "wrist m/s": float(wrist.mean()),
            "wrist talking": float(wrist[talk].mean()), "wrist not": float(wrist[~talk].mean()), "gaze": float(gaze.mean()), "gaze sd": float(gaze.std()),
            "foot slide": float(((foot > 0.03) & low).mean()), "root m/s": float((np.linalg.norm(np.diff(roots[..., :2].numpy(), axis=1), axis=-1) * FPS).mean()),
            "nods": near, "nods else": else_, "distance m": float(np.linalg.norm(user[:, :n, [0, 2]] - roots[..., :2].numpy(), axis=-1).mean()),
            "floor mm": float(-1000 * np.minimum(p[..., 1].min(-1), 0).mean())}
