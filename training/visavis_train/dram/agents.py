"""Agents that live on in their own motion along recorded conversations, for training in what a network does when it runs freely."""
import torch

from ..train.geometry import integrate
from . import pose, roll

PAST, WARM, REACH = 32, 5, 72   # frames of own motion before a stretch; first frame of a window that is forecast; recorded frames behind which an agent begins
LEAST, MOST = -0.1, 1.0         # wanted gaze scores
DROP = (0.05, 0.1, 0.05, 0.2, 0.4)


class Agents:
    """`count` agents in conversations of `data`, each at a frame of a clip, with network state, root and what it is given.

    `stretch` makes `frames` more of each, with gradients through these frames. Of a clip's end an agent goes on in another with the state
    that it has, or begins anew behind recorded poses; one in `short` stretches it does either anyway. Where a recording has no voices, half of
    the agents are given ones of zeros, and half a user who is as still as a head that nobody tracks: sessions have both, recordings neither."""

    def __init__(self, net, data, count, frames, short=12):
        self.data, self.count, self.frames, self.short, self.layout = data, count, frames, short, pose.Layout()
        lengths = data.starts.diff()
        rests = torch.tensor([n.startswith("idle") for n in data.names]) | (data.talk & ~data.has[data.starts[:-1]].bool().any(1))
        self.weights = (lengths * (lengths > REACH + 8 * frames) * torch.where(rests, 1.5, torch.where(data.talk, 1.0, 0.3))).float()
        if not (self.weights > 0).any():
            raise SystemExit(f"no clip is longer than {(REACH + 8 * frames) / 30:.1f} s")
        self.clip, self.at = torch.zeros(count, dtype=torch.long), torch.zeros(count, dtype=torch.long)
        self.flags, self.wanted, self.chosen = torch.zeros(count, 5), torch.zeros(count), torch.zeros(count, dtype=torch.bool)
        self.y, self.roots = torch.zeros(count, PAST, pose.Layout().size), torch.zeros(count, PAST, 3, dtype=torch.float64)
        self.score, self.hushed, self.fixed = torch.zeros(count), torch.zeros(count, dtype=torch.bool), torch.zeros(count, dtype=torch.bool)
        self.seat, self.face = torch.zeros(count, 3), torch.zeros(count, 3)
        self.state = net.state(count)
        self._begin(net, torch.arange(count))

    def _place(self, which):
        """Clips, frames and what is given, drawn anew."""
        n = len(which)
        clip = torch.multinomial(self.weights, n, replacement=True)
        room = self.data.starts.diff()[clip] - REACH - 1 - self.frames
        self.clip[which], self.at[which] = clip, self.data.starts[clip] + 1 + REACH + (torch.rand(n, dtype=torch.float64) * room).long()
        keep = (torch.rand(n, 5) >= torch.tensor(DROP)).float()
        keep[:, 3] *= keep[:, 2]
        mute = ~self.data.has[self.at[which]].bool().any(1)
        self.hushed[which], self.fixed[which] = (mute & (torch.rand(n) < p) for p in (0.5, 0.5))
        self.seat[which], self.face[which] = self.data.head[self.at[which]], self.data.forward[self.at[which]]
        keep[:, :2] *= torch.maximum(self.data.has[self.at[which]], self.hushed[which, None].float())
        self.flags[which] = keep
        self._want(which)

    def _window(self, which, first, frames):
        """Frames of the recordings, with what these agents are given."""
        w = self.data.at(self.clip[which], first, frames)
        w.flags, w.wanted = self.flags[which], self.wanted[which]
        instead = lambda mask, value, of: torch.where(mask[which, None, None], value.to(of.dtype), of)
        w.agent, w.voice = (instead(self.hushed, self.data.hush, v) for v in (w.agent, w.voice))
        w.head, w.forward = instead(self.fixed, self.seat[which, None], w.head), instead(self.fixed, self.face[which, None], w.forward)
        return w

    def _want(self, which):
        """Gaze targets: half of them any score, half (where `chosen` is false) what the recording has."""
        n = len(which)
        self.chosen[which] = torch.rand(n) < 0.5
        near = torch.stack([self.data.gaze[a:a + 128].mean() for a in self.at[which].tolist()])
        self.wanted[which] = torch.where(self.chosen[which], LEAST + (MOST - LEAST) * torch.rand(n), near)
        self.score[which] = self.wanted[which]

    @torch.no_grad()
    def _begin(self, net, which):
        """Behind recorded poses."""
        self._place(which)
        w = self._window(which, self.at[which] - REACH, REACH + 1)
        state = roll.forced(net, w, self.layout, WARM, REACH)[2]
        self.state = roll.each(lambda all_, own: _put(all_, which, own), self.state, state) if len(which) < self.count else state
        self.y[which], self.roots[which] = w.y[:, REACH - PAST:REACH], w.roots[:, REACH - PAST:REACH]

    def _hop(self, which):
        """To another conversation, beside the recorded agent there."""
        self._place(which)
        there = self.data.roots[self.at[which] - 1] + 0.1 * torch.randn(len(which), 3, dtype=torch.float64)
        self.roots[which] = _moved(self.roots[which], there)

    def stretch(self, net):
        """y [B, PAST + frames, D] in metres, roots [B, PAST + frames, 3] f64, the window of these frames; gradients in the last `frames`."""
        over = self.at + self.frames + 1 >= self.data.starts[self.clip + 1]
        leaves = over | (torch.rand(self.count) < 1 / self.short)
        anew = torch.rand(self.count) < 0.5
        if len(which := (leaves & anew).nonzero()[:, 0]):
            self._begin(net, which)
        if len(which := (leaves & ~anew).nonzero()[:, 0]):
            self._hop(which)
        if len(which := (~leaves & (torch.rand(self.count) < 1 / 6)).nonzero()[:, 0]):
            self._want(which)
        w = self._window(torch.arange(self.count), self.at - PAST, PAST + self.frames)
        p = roll.standardise(net, self.y[:, -2:])
        run = roll.Run(net, self.layout, p[:, 1], p[:, 0], self.state, self.roots[:, -1])
        made = [run.step(w.heard(t, t + 1, run.root[:, None]))[0] for t in range(PAST, PAST + self.frames)]
        y = torch.stack(made, 1)
        roots = torch.cat([self.roots, integrate(y[..., :3].double(), self.roots[:, -1])], 1)
        y = torch.cat([self.y, y], 1)
        self.y, self.roots, self.at = y[:, -PAST:].detach(), roots[:, -PAST:].detach(), self.at + self.frames
        self.state = roll.each(torch.Tensor.detach, run.state)
        return y, roots, w

    def state_dict(self):
        tensors = []
        roll.each(tensors.append, self.state)
        return {name: getattr(self, name) for name in ("clip", "at", "flags", "wanted", "chosen", "y", "roots", "score", "hushed", "fixed", "seat", "face")} | {"state": tensors}

    def load_state_dict(self, state):
        tensors = iter(state["state"])
        self.state = roll.each(lambda _: next(tensors), self.state)
        for name, value in state.items():
            if name != "state":
                setattr(self, name, value)


def _put(into, which, rows):
    """Rows [n, ...] at places `which` of the dimension that holds agents: the first, of LSTM states [layers, B, W] the second."""
    return into.index_copy(into.dim() - 2, which, rows)


def _moved(roots, there):
    """Roots [B, T, 3] as a rigid path whose last is at `there` [B, 3]."""
    turned = there[:, None, 2] - roots[:, -1:, 2]
    d = roots[..., :2] - roots[:, -1:, :2]
    c, s = turned.cos(), turned.sin()
    return torch.stack([there[:, None, 0] + c * d[..., 0] + s * d[..., 1], there[:, None, 1] + c * d[..., 1] - s * d[..., 0], roots[..., 2] + turned], -1)
