"""The networks of the tier (mirrored by the runtime's `dram` room): backbones, what they are given, and the step.

A step predicts frame t from p, the standardised pose of the frame before, and e, its step to there in units of `step_std` s:

    m     = f_m(p, e, agent's voice of frame t)                      monadic
    z_m   = p + s m
    d     = f_d(z_m, m, user's row and voice of frame t - 4)         dyadic
    z_d   = p + s d
    Delta = tanh |d - m| = tanh |z_d - z_m| / s
    y     = (1 - Delta) z_m + Delta z_d = p + s ((1 - Delta) m + Delta d)

The paper's: f_m, f_d on the monadic forecast, Delta, the sum, both backbones, the squared error. Ours: forecasts as steps from the last pose, and
Delta in units of a joint's usual step (between frames of 30 Hz poses differ by hundredths of their deviation, where tanh would stay near
zero); e and m given beside the poses (differences would drown in int8 rows); the user's place, head rotation and a wanted gaze score.
"""
import torch
import torch.nn.functional as F
from torch import nn

from ..nets.layers import gelu

DELAY = 4          # frames by which what is known of the user lags: one block
USER = 12          # numbers of a user's row
MOST = 8.0         # e is clamped to this
VARIANTS = ("human-audio", "human-monadic", "avatar-audio", "avatar-monadic", "early-fusion", "no-attention", "dram")


def user_row(head, forward, gaze, flags):
    """Row [..., 12] of the user's head [..., 3] and gaze direction [..., 3] in the agent's heading frame, metres; wanted gaze score [...];
    flags [..., 3] of the three. What is absent is zero."""
    far = (head[..., 0] ** 2 + head[..., 2] ** 2 + 0.01).sqrt()
    there, turned, wanted = flags.unbind(-1)
    place = torch.stack([head[..., 0] / 2, head[..., 2] / 2, head[..., 1] - 1.6, head[..., 0] / far, head[..., 2] / far], -1)
    return torch.cat([place * there[..., None], forward * turned[..., None], torch.stack([there, turned, gaze * wanted, wanted], -1)], -1)


class Tcn(nn.Module):
    """Residual layers h + fc(gelu(conv(h))), conv of kernel 2 over frames t - dilation and t. Zeros before the first frame."""

    def __init__(self, inputs, outputs, width=128, dilations=(1, 2, 4, 8, 16)):
        super().__init__()
        self.dilations = tuple(dilations)
        self.into = nn.Linear(inputs, width)
        self.conv = nn.ModuleList(nn.Conv1d(width, width, 2, dilation=d) for d in dilations)
        self.fc = nn.ModuleList(nn.Linear(width, width) for _ in dilations)
        self.out = nn.Linear(width, outputs)
        for fc in self.fc:
            nn.init.normal_(fc.weight, 0, 0.3 / width ** 0.5)
            nn.init.zeros_(fc.bias)

    @property
    def reach(self):
        return sum(self.dilations) + 1

    def state(self, batch):
        """The last `dilation` inputs of each layer [B, width], the oldest first: zeros. Apart, so that a frame neither copies nor, backwards, fills them all."""
        zero = torch.zeros(batch, self.into.out_features, device=self.out.weight.device)
        return [(zero,) * d for d in self.dilations]

    def forward(self, x, state):
        """x [B, T, inputs] -> [B, T, outputs] and the state after it."""
        h, after, frames = self.into(x), [], x.shape[1]
        for conv, fc, past, d in zip(self.conv, self.fc, state, self.dilations):
            after.append((past + h.unbind(1))[-d:])
            early = torch.stack(past[:frames], 1)
            weight = conv.weight.permute(0, 2, 1).flatten(1)
            pair = torch.cat([early if frames <= d else torch.cat([early, h[:, :frames - d]], 1), h], -1)
            h = h + fc(gelu(F.linear(pair, weight, conv.bias)))
        return self.out(h), after


class Lstm(nn.Module):
    """gelu(linear), then LSTM layers (gates i, f, g, o), then a linear map."""

    def __init__(self, inputs, outputs, width=128, layers=2):
        super().__init__()
        self.into = nn.Linear(inputs, width)
        self.lstm = nn.LSTM(width, width, layers, batch_first=True)
        self.out = nn.Linear(width, outputs)

    def state(self, batch):
        zero = torch.zeros(self.lstm.num_layers, batch, self.lstm.hidden_size, device=self.out.weight.device)
        return zero, zero

    def forward(self, x, state):
        h, after = self.lstm(gelu(self.into(x)), state)
        return self.out(h), after


def backbone(kind, inputs, outputs, size):
    return {"tcn": Tcn, "lstm": Lstm}[kind](inputs, outputs, **size)


class Heard:
    """What a model is given beside poses, [B, T, ...]: agent's voice features with their flag, user's rows and voice features with their flag.
    The user's are those of frame t - 4 at index t."""

    def __init__(self, agent, user, voice):
        self.agent, self.user, self.voice = agent, user, voice

    def cut(self, a, b):
        return Heard(self.agent[:, a:b], self.user[:, a:b], self.voice[:, a:b])


def voice(features, flag):
    """Features [..., A] and flag [..., 1] as an input; zeros where absent."""
    return torch.cat([features * flag, flag], -1)


class Dram(nn.Module):
    """DRAM over poses of `size` numbers and its baselines (`variant`). `sizes`: the backbones' keywords, {"monadic": ..., "dyadic": ...};
    baselines of one network take the dyadic one's."""

    def __init__(self, size, features, kind, sizes, variant="dram"):
        super().__init__()
        self.size, self.variant, self.kind = size, variant, kind
        pose, sound = 2 * size, features + 1
        self.single = variant not in ("dram", "no-attention")
        self.absolute = variant in ("human-audio", "human-monadic", "avatar-audio")   # without the avatar's pose there is nothing to step from
        if self.single:
            inputs = {"human-audio": sound, "human-monadic": USER + sound, "avatar-audio": sound, "avatar-monadic": pose + sound,
                      "early-fusion": pose + 2 * sound + USER}[variant]
            self.only = backbone(kind, inputs, size, sizes["dyadic"])
        else:
            self.monadic = backbone(kind, pose + sound, size, sizes["monadic"])
            self.dyadic = backbone(kind, pose + USER + sound, size, sizes["dyadic"])
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("std", torch.ones(size))
        self.register_buffer("step", torch.ones(size))

    def state(self, batch):
        return [self.only.state(batch)] if self.single else [self.monadic.state(batch), self.dyadic.state(batch)]

    def forward(self, p, before, heard, state):
        """Poses p [B, T, D] and the ones before them [B, T, D], standardised, what is heard and seen of the frames to come [B, T] ->
        forecasts [B, T, D] (not yet orthonormal), Delta [B, T, D] or None, the state after."""
        e = ((p - before) / self.step).clamp(-MOST, MOST)
        if self.single:
            parts = {"human-audio": [heard.voice], "human-monadic": [heard.user, heard.voice], "avatar-audio": [heard.agent],
                     "avatar-monadic": [p, e, heard.agent], "early-fusion": [p, e, heard.agent, heard.user, heard.voice]}[self.variant]
            y, after = self.only(torch.cat(parts, -1), state[0])
            return (y if self.absolute else p + self.step * y), None, [after]
        m, own = self.monadic(torch.cat([p, e, heard.agent], -1), state[0])
        d, other = self.dyadic(torch.cat([p + self.step * m, m, heard.user, heard.voice], -1), state[1])
        if self.variant == "no-attention":
            return p + self.step * d, None, [own, other]
        delta = torch.tanh((d - m).abs())
        return p + self.step * ((1 - delta) * m + delta * d), delta, [own, other]
