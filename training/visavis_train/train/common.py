"""What the training loops share: averages of weights, schedules, checkpoints, logs."""
import copy
import json
import math
import os
import time

import torch


class Ema:
    """Exponential moving average of weights; the rate rises from 0 so that early weights do not linger."""

    def __init__(self, net, rate=0.999):
        self.net, self.rate, self.steps = copy.deepcopy(net).eval().requires_grad_(False), rate, 0

    @torch.no_grad()
    def update(self, net):
        self.steps += 1
        rate = min(self.rate, (1 + self.steps) / (10 + self.steps))
        torch._foreach_lerp_(list(self.net.parameters()), list(net.parameters()), 1 - rate)


class Clock:
    """Training by wall time: progress 0 .. 1 over `minutes`, over all runs of a resumed training."""

    def __init__(self, minutes, spent=0.0):
        self.seconds, self.spent, self.start = 60 * minutes, spent, time.monotonic()

    @property
    def elapsed(self):
        return self.spent + time.monotonic() - self.start

    @property
    def progress(self):
        return min(1.0, self.elapsed / self.seconds)


def rate(peak, step, progress, warmup=200, floor=0.02):
    """Linear warm-up over steps, then a cosine over wall time down to `floor` of the peak."""
    return peak * min(1.0, (step + 1) / warmup) * (floor + (1 - floor) * 0.5 * (1 + math.cos(math.pi * progress)))


class Optimiser:
    """AdamW, and with `muon` Muon (orthogonalised momentum, Jordan 2024) for the matrices inside transformer layers."""

    def __init__(self, net, lr, decay=1e-2, muon=False):
        inner = {id(p) for name, p in net.named_parameters() if muon and ".layers." in "." + name and p.dim() == 2 and ".mod." not in name}
        every = [p for p in net.parameters() if p.requires_grad]
        rest = [p for p in every if id(p) not in inner]
        groups = [{"params": [p for p in rest if p.dim() > 1], "weight_decay": decay}, {"params": [p for p in rest if p.dim() <= 1], "weight_decay": 0.0}]
        self.parts = [torch.optim.AdamW(groups, lr=lr, betas=(0.9, 0.99))]
        if muon:
            self.parts.append(torch.optim.Muon([p for p in every if id(p) in inner], lr=lr, weight_decay=decay, adjust_lr_fn="match_rms_adamw"))

    def zero_grad(self):
        for o in self.parts:
            o.zero_grad()

    def step(self):
        for o in self.parts:
            o.step()

    def set_rate(self, lr):
        for o in self.parts:
            for group in o.param_groups:
                group["lr"] = lr

    def state_dict(self):
        return [o.state_dict() for o in self.parts]

    def load_state_dict(self, state):
        for o, s in zip(self.parts, state):
            o.load_state_dict(s)


def save(path, **state):
    """Checkpoint through a temporary name, so that an interruption leaves the last one whole."""
    torch.save(state, path + ".tmp")
    os.replace(path + ".tmp", path)


class Log:
    """Prints a line and appends it as JSON beside the checkpoint, for `python -m visavis_train.train.curves`."""

    def __init__(self, path, resume=False):
        self.path = path
        if not resume and os.path.exists(path):
            os.remove(path)

    def write(self, **row):
        row = {k: round(v, 6) if isinstance(v, float) else v for k, v in row.items()}
        print(" ".join(f"{k} {v}" for k, v in row.items()), flush=True)
        with open(self.path, "a") as f:
            f.write(json.dumps(row) + "\n")
