"""Data-parallel training in several processes of one machine: each takes its own batches, gradients are averaged.

One exchange a step: on cores that other work shares, that waits less than threads which meet after every operation.
"""
import os
import socket
import subprocess
import sys

import torch
import torch.distributed as dist

RANK = "VISAVIS_RANK"


class Team:
    """This process and its helpers. `size` 1 does nothing."""

    def __init__(self, size):
        self.size, self.rank, self.others = size, int(os.environ.get(RANK, 0)), []
        if size == 1:
            return
        if self.rank == 0:
            with socket.socket() as s:
                s.bind(("127.0.0.1", 0))
                os.environ["MASTER_ADDR"], os.environ["MASTER_PORT"] = "127.0.0.1", str(s.getsockname()[1])
            for rank in range(1, size):
                self.others.append(subprocess.Popen(sys.orig_argv, env=os.environ | {RANK: str(rank)}, start_new_session=True))
        dist.init_process_group("gloo", rank=self.rank, world_size=size)

    @property
    def leads(self):
        """Whether this process logs, validates and saves."""
        return self.rank == 0

    def seed(self, seed, step=0):
        """Seeds this process for a step: numbers that no other step or process draws."""
        torch.manual_seed((seed * 1000003 + self.rank) * 1000003 + step)

    @staticmethod
    def draw(seed, step):
        """A number in 0 .. 1 that all processes draw alike for a step."""
        return torch.rand(1, generator=torch.Generator().manual_seed(seed * 1000003 + step)).item()

    def agree(self, value):
        """The leader's whole number, in all processes."""
        if self.size == 1:
            return value
        shared = torch.tensor([value])
        dist.broadcast(shared, 0)
        return int(shared)

    def first(self, make):
        """What `make` gives; the leader calls it before the others, who then find what it left on disk."""
        made = make() if self.leads else None
        if self.size > 1:
            dist.barrier()
        return made if self.leads else make()

    @torch.no_grad()
    def average(self, net, stop=False):
        """Averages the gradients of `net` in place; returns whether the leader wants to `stop`, so that all do at one step."""
        if self.size == 1:
            return stop
        grads = [p.grad if p.grad is not None else torch.zeros_like(p) for p in net.parameters() if p.requires_grad]
        flat = torch.cat([g.flatten() for g in grads] + [torch.tensor([float(stop and self.leads)])])
        dist.all_reduce(flat)
        stop = bool(flat[-1] > 0)
        flat /= self.size
        at = 0
        for p, g in zip((p for p in net.parameters() if p.requires_grad), grads):
            p.grad = flat[at:at + g.numel()].view_as(g)
            at += g.numel()
        return stop

    def gather(self, items, path):
        """The leader gets the dictionaries of all as one, through files beside `path`; the others get an empty one."""
        if self.size == 1:
            return items
        if not self.leads:
            torch.save(items, f"{path}{self.rank}")
        dist.barrier()
        if self.leads:
            for rank in range(1, self.size):
                items = items | torch.load(f"{path}{rank}", weights_only=True)
                os.remove(f"{path}{rank}")
        dist.barrier()
        return items if self.leads else {}

    def close(self):
        """Waits for the helpers; an error of one is an error here."""
        if self.size > 1:
            dist.destroy_process_group()
            codes = [p.wait() for p in self.others]
            if any(codes):
                raise SystemExit(f"a helper process failed: exit codes {codes}")
