"""Running a model: over recorded poses, and freely over its own, one frame after the other."""
import torch

from ..train.geometry import turn
from . import pose


def standardise(net, y):
    return (y - net.mean) / net.std


def advance(root, y):
    """The root [B, 3] f64 a frame on, by y [B, D]."""
    x, z = turn(root[:, 2], y[:, 0].double(), y[:, 1].double())
    return torch.stack([root[:, 0] + x, root[:, 1] + z, root[:, 2] + y[:, 2].double()], -1)


def proper(net, layout, p):
    """Standardised poses with orthonormal columns, and the same in metres."""
    y = p * net.std + net.mean
    six = pose.orthonormal(y[..., layout.lead:].unflatten(-1, (-1, 6))).flatten(-2)
    y = torch.cat([y[..., :layout.lead], six], -1)
    return standardise(net, y), y


def each(change, state, *others):
    """A state whose tensors are changed, those of `others` at the same places given too."""
    if torch.is_tensor(state):
        return change(state, *others)
    return type(state)(each(change, *parts) for parts in zip(state, *others))


class Run:
    """A model that goes on from standardised poses `p` and, before it, `before` [B, D]; roots [B, 3] at p."""

    def __init__(self, net, layout, p, before, state, root=None):
        self.net, self.layout, self.p, self.before, self.state, self.root = net, layout, p, before, state, root

    def step(self, heard):
        """One frame: y [B, D] in metres, Delta [B, D] or None. `heard`: of that frame, [B, 1]."""
        out, delta, self.state = self.net(self.p[:, None], self.before[:, None], heard, self.state)
        p, y = proper(self.net, self.layout, out[:, 0])
        self.before, self.p = self.p, p
        if self.root is not None:
            self.root = advance(self.root, y.detach())
        return y, None if delta is None else delta[:, 0]


def forced(net, window, layout, first, last, noisy=None):
    """Frames first .. last - 1 of a window, each from the recorded pose before it (or from `noisy` [B, T, D] standardised): forecasts,
    Delta, the state after them."""
    p = standardise(net, layout.take(window.y)) if noisy is None else noisy
    before = p[:, first - 2:last - 2]
    return net(p[:, first - 1:last - 1], before, window.heard(first, last), net.state(len(p)))


@torch.no_grad()
def free(net, window, layout, first, last, warm=5):
    """Recorded poses up to frame first - 1 (the state is warmed from frame `warm` on), then its own: y [B, last - first, D], Delta, roots."""
    p = standardise(net, layout.take(window.y))
    state = forced(net, window, layout, warm, first)[2] if first > warm else net.state(len(p))
    run = Run(net, layout, p[:, first - 1], p[:, first - 2], state, window.roots[:, first - 1] if layout.root else None)
    ys, deltas, roots = [], [], []
    for t in range(first, last):
        y, delta = run.step(window.heard(t, t + 1, run.root[:, None] if layout.root else None))
        ys.append(y)
        deltas.append(delta)
        roots.append(run.root if layout.root else window.roots[:, t])
    return torch.stack(ys, 1), None if deltas[0] is None else torch.stack(deltas, 1), torch.stack(roots, 1)
