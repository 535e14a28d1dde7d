"""What the agent makes of what it hears: shares of the reactions to a sound, frame by frame (mirrors src/hearing/appraisal.rs)."""
import torch
from torch import nn

from .layers import gelu


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
        """Under the bundle's names: the cells' two matrices side by side, one bias."""
        s = {k: v.detach().float() for k, v in self.state_dict().items()}
        out = {f"appraisal.{k}": v.contiguous() for k, v in s.items() if not k.startswith("lstm.")}
        out["appraisal.lstm.weight"] = torch.cat([s["lstm.weight_ih_l0"], s["lstm.weight_hh_l0"]], 1).contiguous()
        return out | {"appraisal.lstm.bias": s["lstm.bias_ih_l0"] + s["lstm.bias_hh_l0"]}

    def fill(self, tensors):
        """The inverse of `tensors`."""
        t = {k.removeprefix("appraisal."): v.float() for k, v in tensors.items() if k.startswith("appraisal.")}
        ih, hh = t.pop("lstm.weight").split(self.width, 1)
        bias = t.pop("lstm.bias")
        self.load_state_dict(t | {"lstm.weight_ih_l0": ih, "lstm.weight_hh_l0": hh, "lstm.bias_ih_l0": bias, "lstm.bias_hh_l0": torch.zeros_like(bias)})
        return self.eval()
