"""The evaluation's windows: which frames of which clips, cut out and put back where they are."""
import os
from dataclasses import dataclass

import numpy as np
from safetensors import safe_open

from ..corpus import store
from ..motion import rig

LEAD, MEASURED = 60, 400    # frames that lead in, frames that are measured (tools/src/eval/window.rs)


@dataclass
class Window:
    name: str       # of its file
    path: str       # of the clip
    start: int      # first frame of what leads in
    meta: dict      # of its file


def windows(folder, clips):
    """Windows that `visavis eval --keep FOLDER` has left, of clips in the folder `clips`."""
    kept, out = os.path.join(folder, "corpus"), []
    for name in sorted(os.listdir(kept)) if os.path.isdir(kept) else ():
        if not name.endswith(".safetensors"):
            continue
        with safe_open(os.path.join(kept, name), framework="numpy") as f:
            meta = f.metadata() or {}
        if not {"clip", "first_frame"} <= meta.keys():
            raise SystemExit(f"{kept}/{name} does not say which frames of which clip it is of; keep windows with `visavis eval --keep`")
        path = os.path.join(clips, os.path.basename(meta["clip"]))
        out.append(Window(name, path if path.endswith(".safetensors") else path + ".safetensors", int(meta["first_frame"]) - LEAD, meta))
    if not out:
        raise SystemExit(f"no windows under {kept}: keep them with `visavis eval --keep {folder}`")
    return out


def cut(window):
    """What leads in and what is measured, seen from where the agent stands at first, as a clip; and that place: (x, z, yaw)."""
    clip, span = store.load(window.path), slice(window.start, window.start + LEAD + MEASURED)
    if not 0 <= window.start <= len(clip.positions) - LEAD - MEASURED:
        raise SystemExit(f"{window.path} has no {LEAD + MEASURED} frames from {window.start} on")
    r = rig.quat_to_mat(clip.rotations[span])
    p, rotations, user = store.to_session(clip.positions[span].astype(np.float64), r, clip.user_head[span].astype(np.float64))
    voice = lambda v: None if v is None else v[rig.SAMPLES_PER_FRAME * span.start:rig.SAMPLES_PER_FRAME * span.stop]
    start = clip.positions[span.start, 0]
    made = store.Clip(p.astype(np.float32), rig.continuous_quats(rig.mat_to_quat(rotations)).astype(np.float32), user.astype(np.float32), voice(clip.agent_voice),
                      voice(clip.user_voice), clip.meta)
    return made, (float(start[0]), float(start[2]), float(rig.yaw_of(r[0, 0])))


def write(folder, row, window, positions, rotations, start):
    """What was made in a window, without what led in, where the clip is: world positions [T, J, 3] and rotations [T, J, 3, 3] as seen from `start`."""
    os.makedirs(folder, exist_ok=True)
    turn, clip = rig.axis_mat("y", start[2]), store.load(window.path, voices=False)
    p = positions[LEAD:] @ turn.T + [start[0], 0, start[1]]
    q = rig.continuous_quats(rig.mat_to_quat(turn @ rotations[LEAD:]))
    user = clip.user_head[window.start + LEAD:window.start + LEAD + len(p)]
    store.rewrite(os.path.join(folder, window.name), store.Clip(p.astype(np.float32), q.astype(np.float32), user, meta=window.meta | {"row": row}))
