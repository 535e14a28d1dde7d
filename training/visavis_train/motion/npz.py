"""Reader of the `.npz` takes: names, parents, offsets [m], local quaternions (w, x, y, z) and root path; Y up, left at +X when facing +Z."""
import numpy as np

from . import rig
from .bvh import Clip, MotionFormatError, Skeleton

FIELDS = {"names": 1, "parents": 1, "offsets": 2, "rot": 3, "root": 2, "fps": 0}


def read_npz(path):
    """One take as a `Clip` in metres; raises `MotionFormatError` where the file does not follow the format."""
    try:
        with np.load(path, allow_pickle=False) as z:
            missing = [k for k in FIELDS if k not in z.files]
            if missing:
                raise MotionFormatError(f"{path}: arrays {missing} are missing; expected {sorted(FIELDS)}")
            got = {k: z[k] for k in FIELDS}
    except (ValueError, OSError, EOFError) as error:
        if isinstance(error, MotionFormatError):
            raise
        raise MotionFormatError(f"{path}: not an .npz of plain arrays ({error})") from error
    for k, dims in FIELDS.items():
        if got[k].ndim != dims:
            raise MotionFormatError(f"{path}: {k} has {got[k].ndim} dimensions, expected {dims}")
    names = [str(n) for n in got["names"]]
    j, t = len(names), len(got["root"])
    want = {"parents": (j,), "offsets": (j, 3), "rot": (t, j, 4), "root": (t, 3)}
    for k, shape in want.items():
        if got[k].shape != shape:
            raise MotionFormatError(f"{path}: {k} is {list(got[k].shape)}, expected {list(shape)}")
    parents = [int(p) for p in got["parents"]]
    if not t or parents[0] >= 0 or any(not 0 <= p < i for i, p in enumerate(parents) if i):
        raise MotionFormatError(f"{path}: parents must come before their children, the root first")
    fps = float(got["fps"])
    if not (np.isfinite(got["rot"]).all() and np.isfinite(got["root"]).all() and 1 <= fps <= 1000):
        raise MotionFormatError(f"{path}: values that are not finite, or a frame rate outside 1 to 1000")
    local = rig.quat_to_mat(np.roll(got["rot"].astype(np.float64), -1, -1))
    skeleton = Skeleton(names, parents, got["offsets"].astype(np.float64), [[] for _ in names])
    return Clip(skeleton, got["root"].astype(np.float64), local, 1.0 / fps)
