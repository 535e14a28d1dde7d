"""The corpus as training takes it: every clip and its mirror image."""
import json
import os

import numpy as np
import torch

from ..motion import rig
from . import layout, nets, react

AFTER = 1.5                                # s after the onset at which a body has turned


def off_source(x, clip, place):
    """Angle [rad] from the hips' heading to the source, as the body is AFTER the onset; and its bearing at the onset."""
    p, r = layout.to_world(x)
    at, first = int(30 * (clip["onset"] + AFTER)), int(30 * clip["onset"])
    bearing = lambda t: rig.wrap(np.arctan2(place[0] - p[t, 0, 0], place[2] - p[t, 0, 2]) - rig.yaw_of(r[t, 0]))
    turned = rig.wrap(rig.yaw_of(r[at, 0]) - rig.yaw_of(r[first, 0]))
    return abs(bearing(at)), bearing(first), turned


class Split:
    """Clips of a split, mapped. Clip n + i is the mirror image of clip i."""

    def __init__(self, folder, split):
        place = os.path.join(folder, split)
        if not os.path.exists(os.path.join(place, "clips.json")):
            raise SystemExit(f"{place} has no clips; python -m visavis_train.mospa.corpus makes them")
        with open(os.path.join(place, "clips.json")) as f:
            self.clips = json.load(f)
        for name in ("motion", "left", "right", "location"):
            setattr(self, name, np.load(os.path.join(place, name + ".npy"), mmap_mode="r"))
        self.genre = np.array([react.GENRES.index(c["genre"]) for c in self.clips])
        self.heard = np.array([c["class"] != "silence" for c in self.clips], np.float32)
        self.reaction = np.array([react.REACTIONS.index(c["reaction"]) for c in self.clips])

    def __len__(self):
        return len(self.clips)

    def statistics(self):
        """Mean and deviation of motion and of an ear's features; numbers of a joint share their deviation."""
        x = np.asarray(self.motion[::3]).reshape(-1, layout.SIZE)
        x = np.concatenate([x, layout.mirror(x)])
        std, out = x.std(0), {}
        hips = np.maximum(std[:3], 0.01)
        for part, n in ((layout.POSITIONS, 3), (layout.ROTATIONS, 6), (layout.VELOCITIES, 3)):
            joint = np.sqrt((std[part].reshape(-1, n) ** 2).mean(-1))
            std[part] = np.repeat(np.maximum(joint, {3: 0.004, 6: 0.03}[n]), n)
        std[:3] = hips                                 # height and way spread differently
        f = np.concatenate([np.asarray(e[::3]) for e in (self.left, self.right)]).reshape(-1, self.left.shape[-1])
        out["motion_mean"], out["motion_std"], out["feature_mean"], out["feature_std"] = x.mean(0), std, f.mean(0), np.maximum(f.std(0), 0.02)
        return {k: torch.tensor(v, dtype=torch.float32) for k, v in out.items()}

    def poses(self, which):
        """Motion [n, T, 264] of clips or mirror images."""
        return np.stack([self.motion[i] if i < len(self) else layout.mirror(np.asarray(self.motion[i - len(self)])) for i in which])

    def ears(self, which):
        """Features of the left and the right ear [n, T, F]."""
        n = len(self)
        both = [(self.left[i], self.right[i]) if i < n else (self.right[i - n], self.left[i - n]) for i in which]
        return tuple(torch.from_numpy(np.stack(e)) for e in zip(*both))

    def given(self, net, which):
        """What the network is given for clips: heard [n, T, 2 F], row [n, 5], genre [n]."""
        at = np.asarray(which) % len(self)
        place = torch.from_numpy(self.location[at] * np.where((np.asarray(which) >= len(self))[:, None], [-1, 1, 1], 1)).float()
        return net.hear(*self.ears(which)), nets.source_row(place, torch.from_numpy(self.heard[at])), torch.from_numpy(self.genre[at])
