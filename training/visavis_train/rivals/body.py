"""From a network's frames to a body on the rig's bones, by the rule of the runtime's fit (`src/pose/fit.rs`): where rotations are known, twist is theirs and
direction is the positions'; where they are not, a joint is turned as its parent is, then swung to where its child was decoded."""
import numpy as np

from ..motion import rig

CHILDREN = [[c for c, p in enumerate(rig.PARENTS) if p == j] for j in range(rig.J)]
LIMBS = {rig.INDEX[side + upper]: (rig.INDEX[side + lower], rig.INDEX[side + end])
         for side in ("left", "right") for upper, lower, end in (("UpperArm", "LowerArm", "Hand"), ("UpperLeg", "LowerLeg", "Foot"))}
KEEP = 4 * 0.1 ** 2 / 12    # weight of a decoded rotation against a child's position where a joint has several
FAINT = 1e-4                # the same of a parent's rotation that stands in for one


def swung(rotation, bone, to):
    """Rotations [T, 3, 3] swung by the shortest arc so that `bone` [3] points to `to` [T, 3]."""
    return rig.between(rig.unit(rotation @ bone), rig.unit(to)) @ rotation


def bent(middle, end, lengths):
    """Where the middle joint of a limb comes to lie so that its end is reached: decoded places [T, 3] from the first joint on, bent towards the decoded middle."""
    a, b = lengths
    far = np.clip(np.linalg.norm(end, axis=-1, keepdims=True), abs(a - b) + 1e-9, a + b - 1e-9)
    along = rig.unit(end)
    side = rig.unit(middle - np.sum(middle * along, -1, keepdims=True) * along)
    cosine = np.clip((a * a + far * far - b * b) / (2 * a * far), -1, 1)
    return a * (cosine * along + np.sqrt(1 - cosine ** 2) * side)


def fit(p, axes):
    """Rotations [T, J, 3, 3] on the rig for decoded positions [T, J, 3] and rotations [T, J, 3, 3] or None, all in one frame."""
    known = axes is not None
    decoded = rig.polar(axes) if known else None
    out, at = np.empty((len(p), rig.J, 3, 3)), np.empty_like(p)
    for j, parent in enumerate(rig.PARENTS):
        above = out[:, parent] if j else np.broadcast_to(np.eye(3), (len(p), 3, 3))
        at[:, j] = at[:, parent] + above @ rig.OFFSETS[j] if j else p[:, 0]
        r, to = decoded[:, j] if known else above, [p[:, c] - at[:, j] for c in CHILDREN[j]]
        if j in LIMBS:
            middle, end = LIMBS[j]
            to = [bent(p[:, middle] - at[:, j], p[:, end] - at[:, j], [np.linalg.norm(rig.OFFSETS[k]) for k in LIMBS[j]])]
        if len(to) == 1:
            r = swung(r, rig.OFFSETS[CHILDREN[j][0]], to[0])
        elif to:
            pulled = sum(d[:, :, None] * rig.OFFSETS[c] for d, c in zip(to, CHILDREN[j]))
            r = rig.polar(pulled + (KEEP if known else FAINT) * r)
        out[:, j] = r
    return out


def motion(form, x, roots):
    """World positions [T, J, 3] and rotations [T, J, 3, 3] of features [T, F] at roots [T, 3] (x, z, yaw)."""
    axes = form.axes(x.double())
    local = fit(form.points(x.double()).numpy(), None if axes is None else axes.numpy())
    yaw = roots[:, 2].numpy()
    turn = rig.axis_mat("y", yaw)
    hips = np.einsum("tab,tb->ta", turn, form.points(x.double())[:, 0].numpy())
    rotations = turn[:, None] @ local
    return rig.fk_global(hips + np.stack([roots[:, 0].numpy(), 0 * yaw, roots[:, 1].numpy()], -1), rotations), rotations
