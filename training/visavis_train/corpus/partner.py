"""The user's head: where it points, its nods, and the agent's nods that mirror them.

Works on finished clips, so that corpora made without it can have it too:

    python -m visavis_train.corpus.partner --corpus DIR --out DIR2 [--every 2]

The user looks at the agent's head by the rules of `attention.py` (contact, aversions, nods at the ends of the agent's phrases), at a level of
gaze and with a rate of its own, and nods now and then while it speaks. A person mirrors nods that it sees (Chartrand & Bargh 1999; head nods
among dyads, Hale et al. 2020, lag about 0.6 s): the agent answers a share of the user's nods with a smaller one, unless it looks away.
"""
import argparse
import json
import os

import numpy as np

from ..motion import rig
from . import attention, store
from .signals import FPS, delay, follow, gaussian

HEAD, NECK = rig.INDEX["head"], rig.INDEX["neck"]
SEEN = 0.03                        # rad of pitch from which a nod can be seen
ECHO, LAG, SIZE = 0.5, (0.35, 0.8), (0.6, 1.0)   # share of nods that are mirrored, seconds after their start, their size
CONTACT = 0.6                      # least gaze score of an agent who mirrors


def angles(rng, head, user, agent_phrases, user_phrases):
    """Yaw, pitch, roll [T, 3] (rad) of the user's head at user [T, 3] before an agent's head [T, 3], and the nods' pitch in it [T]."""
    frames = len(user)
    speaking = attention.mask(user_phrases, frames)
    level = attention.level_track(rng, frames)
    offset, _ = attention.offsets(rng, level, speaking)
    away = head - user
    facing = np.unwrap(np.arctan2(away[:, 0], away[:, 2]))
    body = gaussian(follow(facing, 5.0, 4.0, 30.0), 6.0)
    yaw, pitch, roll = attention.head_angles(rng, user, head, offset, body, np.zeros((frames, 3)))
    nods = attention.nods(rng, frames, agent_phrases, speaking)
    if user_phrases and rng.random() < 0.6:            # nods of assent while one speaks
        nods = nods + attention.nods(rng, frames, user_phrases, np.zeros(frames, bool)) * 0.7
    beats = gaussian(rng.standard_normal(frames), 2.0) * 0.02 * gaussian(speaking.astype(float), 4.0)
    return np.stack([yaw, pitch + nods + beats, roll], -1), nods


def starts(nods):
    """Runs [(start, end)] of frames in which a nod can be seen."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (nods > SEEN).astype(int), [0]])))
    runs = [list(r) for r in edges.reshape(-1, 2)]
    out = runs[:1]
    for a, b in runs[1:]:                              # cycles of one nod
        if a - out[-1][1] < 0.5 * FPS:
            out[-1][1] = b
        else:
            out.append([a, b])
    return [(max(a - 4, 0), b + 4) for a, b in out]


def echoes(rng, nods, contact):
    """Pitch [T] of the agent's mirrored nods; `contact` [T] bool: it looks at the user."""
    out, free = np.zeros(len(nods)), 0
    for a, b in starts(nods):
        at = a + int(FPS * rng.uniform(*LAG))
        size = rng.uniform(*SIZE)
        if rng.random() < ECHO and at >= free and at + b - a < len(nods) and contact[a]:
            out[at:at + b - a] += size * nods[a:b]
            free = at + b - a + FPS
    return gaussian(out, 1.0)


def nod(positions, rotations, pitch):
    """Adds pitch [T] to head (0.7) and neck (0.3) of arrays in the world."""
    local = rig.global_to_local(rotations)
    for j, share in ((NECK, 0.3), (HEAD, 0.7)):
        local[:, j] = local[:, j] @ rig.axis_mat("x", share * pitch)
    turned = rig.local_to_global(local)
    moved = positions.copy()
    moved[:, HEAD] = positions[:, NECK] + turned[:, NECK] @ rig.OFFSETS[HEAD]
    return moved, turned


def perform(rng, positions, rotations, user, agent_phrases, user_phrases):
    """The user's head rotations [T, 3, 3], the agent's positions and rotations with mirrored nods, the user's nods [(start, end)] in frames."""
    head = positions[:, HEAD] + rotations[:, HEAD] @ rig.EYES
    turn, nods = angles(rng, head, user, agent_phrases, user_phrases)
    contact = rig.gaze_score(positions, rotations, user) > CONTACT
    positions, rotations = nod(positions, rotations, echoes(rng, nods, contact))
    return rig.euler_yxz(*turn.T), positions, rotations, [[int(a), int(b)] for a, b in starts(nods)]


def seeded(text):
    """The generator of a clip, from its name or seed: apart from those that made the rest of it."""
    return np.random.default_rng([int(b) for b in text.encode()] + [18])


def extend(clip, name):
    """A conversation of a corpus without user's head rotations, with them; other clips as they are."""
    if clip.meta.get("kind") != "talk" or clip.user_head_rotation is not None:
        return clip
    phrases = [json.loads(clip.meta.get(k, "[]")) for k in ("agent_phrases", "user_phrases")]
    seen, p, r, nods = perform(seeded(clip.meta.get("seed", name)), clip.positions.astype(np.float64), rig.quat_to_mat(clip.rotations),
                               clip.user_head.astype(np.float64), *phrases)
    clip.meta["user_nods"] = json.dumps(nods)
    clip.positions, clip.rotations = p.astype(np.float32), rig.continuous_quats(rig.mat_to_quat(r)).astype(np.float32)
    clip.user_head_rotation = rig.continuous_quats(rig.mat_to_quat(seen)).astype(np.float32)
    return clip


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--splits", default="val,test,train")
    parser.add_argument("--every", type=int, default=1, help="of train, take one clip in so many [1]")
    args = parser.parse_args()
    if os.path.abspath(args.corpus) == os.path.abspath(args.out):
        raise SystemExit("--out must be another folder than --corpus")
    for split in args.splits.split(","):
        os.makedirs(os.path.join(args.out, split), exist_ok=True)
        paths = store.list_clips(args.corpus, split)[::args.every if split == "train" else 1]
        for path in paths:
            store.rewrite(os.path.join(args.out, split, os.path.basename(path)), extend(store.load(path), os.path.basename(path)))
        print(f"{split}: {len(paths)} clips", flush=True)


if __name__ == "__main__":
    main()
