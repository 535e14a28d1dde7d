"""The part of a training loop that all trainers share: everything after the loss.

    loop = Loop(team, net, args, ...)
    for step in loop:
        ...
        loop.update(loss, part=..., ...)
        loop.report(100, measure, 500)
    loop.finish(measure)
"""
import signal
import time

import torch
from torch import nn

from . import common, curves

PROBE = (10, 40)  # steps between which `--minutes` measures


class Loop:
    """Gradients averaged over the team, a step at the scheduled rate, running averages of weights, log and checkpoint at `args.out`.

    Each step's random numbers follow from (seed, process, step) alone, and a checkpoint holds all else that a step depends on: stopped and
    resumed, a training gives the weights of an uninterrupted one. `beside`: {name: module} trained along, `averages` theirs. `memory`: an
    object with `state_dict` and `load_state_dict`, kept in the checkpoint too. `kept`: what else a checkpoint holds. A checkpoint of
    `common.light`, averaged weights alone, is gone on with too, the optimiser beginning anew."""

    def __init__(self, team, net, args, warmup=200, average=0.998, beside=None, memory=None, **kept):
        self.team, self.net, self.args, self.warmup, self.memory, self.kept = team, net, args, warmup, memory, kept
        self.beside = beside or {}
        self.trained, self.step, self.spent, self.steps = nn.ModuleList([net, *self.beside.values()]), 0, 0.0, args.steps if args.minutes is None else None
        self.optim = common.optimiser(self.trained, args.lr, fresh=getattr(args, "fresh", 1.0))
        state = common.load(args.out) if args.resume else None
        if state:
            weights = lambda kept: kept.get("net", kept["ema"])
            net.load_state_dict(weights(state))
            self.step, self.spent, self.steps = state["step"], state["elapsed"], self.steps or state["steps"]
            for name, module in self.beside.items():
                module.load_state_dict(weights(state["beside"][name]))
            if "optim" in state:
                self.optim.load_state_dict(state["optim"])
            if memory and "memory" in state:
                memory.load_state_dict(state["memory"])
        self.first, self.cold = self.step, self.step if state and "optim" not in state else 0
        self.ema = common.Ema(net, average)
        self.averages = {name: common.Ema(module, average) for name, module in self.beside.items()}
        if state:
            self.ema.net.load_state_dict(state["ema"])
            for name, ema in self.averages.items():
                ema.net.load_state_dict(state["beside"][name]["ema"])
        self.sums, self.asked, self.stopping, self.started = {}, False, False, time.monotonic()
        self.kept_at = self.probed = self.started
        self.log = None
        if team.leads:
            common.config(args.out, args)
            self.log = common.Log(args.out + ".jsonl", self.step if state else None)
            for s in (signal.SIGTERM, signal.SIGINT):
                signal.signal(s, self._stop)

    def _stop(self, *_):
        self.asked = True

    @property
    def elapsed(self):
        return self.spent + time.monotonic() - self.started

    @property
    def progress(self):
        return min(1.0, self.step / self.steps) if self.steps else 0.0

    def __iter__(self):
        while self.steps is None or self.step < self.steps:
            self.team.seed(self.args.seed, self.step)
            yield self.step
            if self.steps is None:
                self._probe()
            if self.stopping:
                self._interrupted()

    def _probe(self):
        """`--minutes`: fixes the number of steps once their time is known."""
        done = self.step - self.first
        if done in PROBE and next(self.net.parameters()).is_cuda:
            torch.cuda.synchronize()
        if done == PROBE[0]:
            self.probed = time.monotonic()
        elif done == PROBE[1]:
            pace = (time.monotonic() - self.probed) / (PROBE[1] - PROBE[0])
            self.steps = self.team.agree(max(self.step, self.step + int((60 * self.args.minutes - self.elapsed) / pace)))

    def _interrupted(self):
        if self.team.leads:
            self.keep()
            print(f"stopped at step {self.step} of {self.steps}; --resume goes on", flush=True)
        self.team.close()
        raise SystemExit(128 + signal.SIGTERM)

    def update(self, loss, /, **parts):
        """One step down `loss`; `parts` are what the next line of the log averages."""
        common.set_rate(self.optim, common.rate(self.args.lr, self.step - self.cold, self.progress, self.warmup))
        self.optim.zero_grad()
        loss.backward()
        self.stopping = self.team.average(self.trained, self.asked)
        nn.utils.clip_grad_norm_(self.trained.parameters(), 1.0)
        self.optim.step()
        self.step += 1
        self.ema.update(self.net, self.step)
        for name, ema in self.averages.items():
            ema.update(self.beside[name], self.step)
        for name, value in parts.items():
            self.sums.setdefault(name, []).append(value.detach() if torch.is_tensor(value) else value)

    def report(self, every, measure=None, rarely=None):
        """The leader, each `every` steps: a line of the log, and each `rarely` steps what `measure` says of the averaged net; now and then a checkpoint."""
        if self.team.leads and self.step % every == 0:
            self.write(measure if self.step % (rarely or every) == 0 else None)
        if self.team.leads and time.monotonic() - self.kept_at > 60 * self.args.keep_minutes:
            self.keep()

    def write(self, measure=None):
        means = {name: sum(map(float, values)) / len(values) for name, values in self.sums.items()}
        self.sums = {}
        with torch.random.fork_rng():
            measured = measure(self.ema.net) if measure else {}
        self.log.write(step=self.step, progress=self.progress, minutes=self.elapsed / 60, **means, **measured)

    def keep(self):
        """Writes the checkpoint."""
        beside = {name: {"net": module.state_dict(), "ema": self.averages[name].net.state_dict()} for name, module in self.beside.items()}
        memory = {"memory": self.memory.state_dict()} if self.memory else {}
        common.save(self.args.out, net=self.net.state_dict(), ema=self.ema.net.state_dict(), optim=self.optim.state_dict(), beside=beside, step=self.step,
                    steps=self.steps, elapsed=self.elapsed, **memory, **self.kept)
        self.kept_at = time.monotonic()

    def finish(self, measure=None):
        """The last line and checkpoint; waits for the team."""
        if self.team.leads:
            self.write(measure)
            self.keep()
            curves.draw(self.log.path, self.args.out + ".png")
        self.team.close()
