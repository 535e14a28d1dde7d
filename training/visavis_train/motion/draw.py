"""Stick-figure contact sheets (needs matplotlib)."""
import numpy as np

from . import rig


def contact_sheet(path, positions, rotations=None, user=None, frames=None, rows=3, cols=8, title="", view_yaw=0.5):
    """PNG of `rows` x `cols` figures seen from the side `view_yaw` [rad] of +Z; left limbs red, right limbs blue.

    Each panel is centred on the agent's hips; the user's head is an orange dot where it is within 2 m of the picture."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    if frames is None:
        frames = np.linspace(0, len(positions) - 1, rows * cols).astype(int)
    fig, axes = plt.subplots(rows, cols, figsize=(cols * 1.9, rows * 2.3))
    ax_x = np.array([np.cos(view_yaw), 0, -np.sin(view_yaw)])
    for ax, t in zip(np.ravel(axes), frames):
        p = positions[t] - positions[t, 0] * [1, 0, 1]
        u = np.stack([p @ ax_x, p[:, 1]], 1)
        for j, parent in enumerate(rig.PARENTS):
            if parent >= 0:
                n = rig.NAMES[j]
                ax.plot(*u[[parent, j]].T, color="r" if n.startswith("left") else "b" if n.startswith("right") else "k", lw=1.4)
        if rotations is not None:
            h = rig.INDEX["head"]
            seg = np.stack([p[h] + rotations[t, h] @ rig.HEAD_BACK, p[h] + rotations[t, h] @ (rig.EYES * [1, 1, 2])])
            ax.plot(seg @ ax_x, seg[:, 1], "g", lw=2.5)
            for side, sgn in (("left", 1), ("right", -1)):
                w = rig.INDEX[side + "Hand"]
                seg = np.stack([p[w], p[w] + rotations[t, w] @ [sgn * 0.14, 0, 0]])
                ax.plot(seg @ ax_x, seg[:, 1], "m", lw=1)
        if user is not None:
            q = user[t] - positions[t, 0] * [1, 0, 1]
            ax.plot([q @ ax_x], [q[1]], "o", color="orange")
        ax.axhline(0, color="gray", lw=0.5)
        ax.set_xlim(-1.0, 1.0), ax.set_ylim(-0.15, 1.95), ax.set_aspect("equal"), ax.axis("off")
        ax.set_title(f"{t / rig.FPS:.1f}s", fontsize=7, pad=0)
    fig.suptitle(title, fontsize=8)
    fig.subplots_adjust(0, 0, 1, 0.94, 0.01, 0.06)
    fig.savefig(path, dpi=75)
    plt.close(fig)
