"""What the training loops share: averages of weights, schedules, checkpoints, logs, and the loop's end itself."""
import copy
import json
import math
import os
import time

import torch
from torch import nn


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


class Loop:
    """How every training loop goes on after its loss: gradients averaged over the team, a step at the scheduled rate, the running
    average of weights, log and checkpoint at `out`.

    `beside`: modules that are trained along and kept by the caller, `averages` theirs. `resume` goes on where `out` stands. `kept`: what else a checkpoint holds."""

    def __init__(self, team, net, out, minutes, lr, warmup=200, average=0.998, resume=False, beside=(), **kept):
        self.team, self.net, self.out, self.lr, self.warmup, self.kept = team, net, out, lr, warmup, kept
        self.trained, self.step, spent = nn.ModuleList([net, *beside]), 0, 0.0
        self.optim = optimiser(self.trained, lr)
        state = torch.load(out, weights_only=False) if resume else None
        if state:
            net.load_state_dict(state["net"])
            self.optim.load_state_dict(state["optim"])
            self.step, spent = state["step"], state["elapsed"]
        self.ema, self.averages = Ema(net, average), [Ema(module, average) for module in beside]
        if state:
            self.ema.net.load_state_dict(state["ema"])
            self.ema.steps = self.step
        self.clock, self.sums = Clock(minutes, spent), {}
        self.progress = self.clock.progress
        self.log = Log(out + ".jsonl", resume) if team.leads else None

    def update(self, loss, /, **parts):
        """One step down `loss`; `parts` are what the next line of the log averages."""
        set_rate(self.optim, rate(self.lr, self.step, self.progress, self.warmup))
        self.optim.zero_grad()
        loss.backward()
        self.progress = self.team.average(self.trained, self.clock.progress)
        nn.utils.clip_grad_norm_(self.trained.parameters(), 1.0)
        self.optim.step()
        self.ema.update(self.net)
        for average, module in zip(self.averages, self.trained[1:]):
            average.update(module)
        self.step += 1
        for name, value in parts.items():
            self.sums.setdefault(name, []).append(value.item() if torch.is_tensor(value) else value)

    def report(self, every, measure=None, rarely=None):
        """The leader, each `every` steps: a line of the log, and each `rarely` steps what `measure` says of the averaged net and a checkpoint."""
        if self.team.leads and self.step % every == 0:
            measured = self.step % (rarely or every) == 0
            self.write(measure if measured else None)
            if measured:
                self.keep()

    def write(self, measure=None):
        means = {name: sum(values) / len(values) for name, values in self.sums.items()}
        self.sums = {}
        self.log.write(step=self.step, minutes=self.clock.elapsed / 60, **means, **(measure(self.ema.net) if measure else {}))

    def keep(self):
        """Writes the checkpoint."""
        save(self.out, net=self.net.state_dict(), ema=self.ema.net.state_dict(), optim=self.optim.state_dict(), step=self.step,
             elapsed=self.clock.elapsed, **self.kept)

    def finish(self, measure=None):
        """The last line and checkpoint; waits for the team."""
        if self.team.leads:
            self.write(measure)
            self.keep()
        self.team.close()
