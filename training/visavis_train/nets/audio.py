"""Causal strided convolutions over 24 kHz mono, one feature vector a frame (mirrors src/audio)."""
import torch
from torch import nn
import torch.nn.functional as F

from .layers import gelu

FRAME_SAMPLES = 800

BASE_LAYERS = [
    (1, 24, 10, 5, False), (24, 48, 10, 5, False), (48, 96, 8, 4, False), (96, 160, 8, 4, False), (160, 256, 4, 2, False),
    (256, 256, 3, 1, True), (256, 256, 3, 1, True),
]


class AudioEncoder(nn.Module):
    """`layers`: (inputs, outputs, kernel, stride, residual); strides multiply to 800 samples."""

    def __init__(self, layers=None, features=64):
        super().__init__()
        self.spec = [tuple(s) for s in (layers or BASE_LAYERS)]
        total = 1
        for inputs, outputs, kernel, stride, residual in self.spec:
            total *= stride
            if kernel < stride or (residual and (stride != 1 or inputs != outputs)):
                raise ValueError("a convolution needs kernel >= stride; a residual one stride 1 and equal channels")
        if total != FRAME_SAMPLES:
            raise ValueError(f"strides multiply to {total}, not {FRAME_SAMPLES}")
        self.conv = nn.ModuleList(nn.Conv1d(i, o, k, s) for i, o, k, s, _ in self.spec)
        self.out = nn.Linear(self.spec[-1][1], features)

    def state(self, batch=1):
        """Left context at the start of a signal: kernel - stride zeros for each convolution."""
        return [torch.zeros(batch, i, k - s, device=self.out.weight.device) for i, _, k, s, _ in self.spec]

    def forward(self, wave, state=None):
        """wave [B, 800 T] -> features [B, T, D_a]; a state from `state()` is updated in place for streaming."""
        x = wave[:, None, :]
        for i, (conv, (_, _, kernel, stride, residual)) in enumerate(zip(self.conv, self.spec)):
            left = kernel - stride
            if state is None:
                padded = F.pad(x, (left, 0))
            else:
                padded = torch.cat([state[i], x], -1)
                state[i] = padded[..., padded.shape[-1] - left:]
            y = gelu(conv(padded))
            x = x + y if residual else y
        return self.out(x.transpose(1, 2))
