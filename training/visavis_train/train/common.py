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


def optimiser(net, lr, decay=1e-2):
    """AdamW; matrices decay, vectors do not."""
    every = [p for p in net.parameters() if p.requires_grad]
    groups = [{"params": [p for p in every if p.dim() > 1], "weight_decay": decay}, {"params": [p for p in every if p.dim() <= 1], "weight_decay": 0.0}]
    return torch.optim.AdamW(groups, lr=lr, betas=(0.9, 0.99))


def set_rate(optim, lr):
    for group in optim.param_groups:
        group["lr"] = lr


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
