"""What the agent makes of what it hears: shares of the reactions to a sound, frame by frame (mirrors src/hearing/appraisal.rs)."""
import torch
from torch import nn

from .layers import gelu
from .lstm import packed, unpacked


class Appraisal(nn.Module):
    """gelu(linear), a layer of LSTM cells (gates i, f, g, o), a linear map, softmax."""

    def __init__(self, features, reactions, width=48):
        """`features`: of the encoder's frames; `reactions`: their names."""
        super().__init__()
        self.reactions, self.width = tuple(reactions), width
        self.into = nn.Linear(features + 3, width)
        self.lstm = nn.LSTM(width, width, batch_first=True)
        self.out = nn.Linear(width, len(self.reactions))

    def forward(self, features, levels, sensitivity):
        """Logits [B, T, R] of streams from their beginning: features [B, T, D_s], levels [B, T, 2], sensitivity [B]."""
        return self.told(torch.cat([features, levels, sensitivity[:, None, None].expand(-1, features.shape[1], 1)], -1))

    def told(self, rows):
        """Logits of input rows [B, T, D_s + 3]."""
        return self.out(self.lstm(gelu(self.into(rows)))[0])

    @torch.no_grad()
    def behind(self, features, levels, sensitivity):
        """Features with the shares of the reactions behind them [T, D_s + R], of one stream."""
        logits = self(features[None], levels[None].to(features.dtype), torch.tensor([float(sensitivity)]))[0]
        return torch.cat([features, logits.softmax(-1)], -1)

    def tensors(self):
        """Under the bundle's names."""
        out = {f"appraisal.{k}": v.detach().float() for k, v in self.state_dict().items() if not k.startswith("lstm.")}
        return out | dict(zip(("appraisal.lstm.weight", "appraisal.lstm.bias"), packed(self.lstm)))

    def fill(self, tensors):
        """The inverse of `tensors`."""
        t = {k.removeprefix("appraisal."): v.float() for k, v in tensors.items() if k.startswith("appraisal.")}
        cells = unpacked(t.pop("lstm.weight"), t.pop("lstm.bias"))
        self.load_state_dict(t | {f"lstm.{k}": v for k, v in cells.items()})
        return self.eval()
