"""Statistics and plausibility of a corpus: `python -m visavis_train.corpus.check DIR`."""
import sys

import numpy as np

from ..motion import rig
from . import people, store, voices

FEET = [rig.INDEX["leftToes"], rig.INDEX["rightToes"]]
WRISTS = [rig.INDEX["leftHand"], rig.INDEX["rightHand"]]


def foot_slide(positions):
    """Per frame: a toe below 5 cm that moves faster than 3 cm/s horizontally (DESIGN 10), [T-1] bool."""
    toes = positions[:, FEET]
    v = np.linalg.norm(np.diff(toes[..., [0, 2]], axis=0), axis=-1) * rig.FPS
    return ((toes[1:, :, 1] < 0.05) & (v > 0.03)).any(1)


def support_speed(positions):
    """Horizontal speed of the lower foot [T-1], m/s."""
    toes = positions[:, FEET]
    v = np.linalg.norm(np.diff(toes[..., [0, 2]], axis=0), axis=-1) * rig.FPS
    return np.where(toes[1:, 0, 1] < toes[1:, 1, 1], v[:, 0], v[:, 1])


def bone_error(positions):
    """Largest deviation of any bone from the rig's length [m]."""
    worst = 0.0
    for j, parent in enumerate(rig.PARENTS):
        if parent >= 0:
            l = np.linalg.norm(positions[:, j] - positions[:, parent], axis=1)
            worst = max(worst, float(np.abs(l - np.linalg.norm(rig.OFFSETS[j])).max()))
    return worst


def trunk_depth(positions, rotmats):
    """How deep wrists and elbows are inside the trunk [T]: an elliptic cylinder of half axes 0.14 x 0.10 m, hips to shoulders."""
    depth = np.zeros(len(positions))
    for base, top in (("hips", "chest"), ("chest", "neck")):
        b, t = rig.INDEX[base], rig.INDEX[top]
        for n in ("leftLowerArm", "rightLowerArm", "leftHand", "rightHand"):
            q = np.einsum("tba,tb->ta", rotmats[:, b], positions[:, rig.INDEX[n]] - positions[:, b])
            h = np.linalg.norm(positions[:, t] - positions[:, b], axis=1)
            r = np.hypot(q[:, 0] / 0.14, q[:, 2] / 0.10)
            inside = (q[:, 1] > 0) & (q[:, 1] < h) & (r < 1)
            depth = np.maximum(depth, np.where(inside, (1 - r) * 0.10, 0))
    return depth


def clip_stats(clip):
    """Per-frame quantities of one clip, as a dict of arrays."""
    p = clip.positions.astype(np.float64)
    r = rig.quat_to_mat(clip.rotations)
    v = np.linalg.norm(np.diff(p, axis=0), axis=-1) * rig.FPS
    a = np.linalg.norm(np.diff(p, 2, axis=0), axis=-1) * rig.FPS ** 2
    speaking = np.zeros(len(p), bool)
    if clip.agent_voice is not None:
        loud = voices.envelope(clip.agent_voice / 32768.0)
        speaking = loud > max(0.1 * np.percentile(loud, 98), 1e-3)
        k = np.convolve(speaking, np.ones(15), "same") > 4
        speaking = k
    return {"g": rig.gaze_score(p, r, clip.user_head), "slide": foot_slide(p), "support": support_speed(p),
            "wrist": v[:, WRISTS].mean(1), "speed": v.max(1), "accel": a.max(1), "toe": p[:, FEET, 1].min(1),
            "ankle": p[:, [rig.INDEX["leftFoot"], rig.INDEX["rightFoot"]], 1].min(1),
            "trunk": trunk_depth(p, r), "speaking": speaking, "dist": np.linalg.norm((clip.user_head - p[:, 0])[:, [0, 2]], axis=1),
            "bone": np.array([bone_error(p)])}


def report(folder, splits=("train", "val", "test")):
    """Text table of a corpus, by split and kind of clip."""
    lines = []
    for split in splits:
        kinds, talks = {}, people.Conversations()
        for path in store.list_clips(folder, split):
            clip = store.load(path)
            kinds.setdefault(clip.meta.get("kind", "?"), []).append(clip_stats(clip))
            if clip.meta.get("kind") == "talk":
                talks.add(clip)
        for kind, rows in sorted(kinds.items()):
            cat = {k: np.concatenate([r[k] for r in rows]) for k in rows[0]}
            sp, sp1 = cat["speaking"], np.concatenate([r["speaking"][1:] for r in rows])
            means = np.array([r["g"].mean() for r in rows])
            mean = lambda x, m: float(x[m].mean()) if m.any() else float("nan")
            lines += [
                f"{split}/{kind}: {len(rows)} clips, {len(cat['g']) / rig.FPS / 3600:.2f} h",
                f"  gaze g mean {cat['g'].mean():.3f}, speaking {mean(cat['g'], sp):.3f}, else {mean(cat['g'], ~sp):.3f}; clip means "
                f"{np.percentile(means, [0, 5, 25, 50, 75, 100]).round(2).tolist()}",
                "  g histogram -1..1 in fifths of 0.2: " + " ".join(f"{x:.3f}" for x in np.histogram(cat["g"], 10, (-1, 1))[0] / len(cat["g"])),
                f"  foot slide {cat['slide'].mean():.3f}, support foot {cat['support'].mean():.3f} m/s, lowest toe {cat['toe'].min():.3f}, "
                f"lowest ankle {cat['ankle'].min():.3f} m",
                f"  wrist speed speaking {mean(cat['wrist'], sp1):.3f}, else {mean(cat['wrist'], ~sp1):.3f} m/s; speaking {sp.mean():.2f} of the time",
                f"  joint speed p99.9 {np.percentile(cat['speed'], 99.9):.2f} max {cat['speed'].max():.2f} m/s; acceleration p99.9 "
                f"{np.percentile(cat['accel'], 99.9):.0f} max {cat['accel'].max():.0f} m/s2",
                f"  arm in trunk {(cat['trunk'] > 0.02).mean():.4f} of frames, deepest {cat['trunk'].max():.3f} m; user distance p5/50/95 "
                f"{np.percentile(cat['dist'], [5, 50, 95]).round(2).tolist()}; bones off by {cat['bone'].max():.1e} m",
            ] + (people.talk_lines(talks.row()) if kind == "talk" else [])
    return "\n".join(lines)


if __name__ == "__main__":
    print(report(sys.argv[1], sys.argv[2:] or ("train", "val", "test")))
