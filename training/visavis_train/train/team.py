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

    def seed(self, seed):
        torch.manual_seed(seed + 1000003 * self.rank)

    @torch.no_grad()
    def average(self, net, progress):
        """Averages the gradients of `net` in place; returns the leader's `progress`, so that all stop at one step."""
        if self.size == 1:
            return progress
        grads = [p.grad if p.grad is not None else torch.zeros_like(p) for p in net.parameters() if p.requires_grad]
        flat = torch.cat([g.flatten() for g in grads] + [torch.tensor([progress * self.size if self.leads else 0.0])])
        dist.all_reduce(flat)
        flat /= self.size
        at = 0
        for p, g in zip((p for p in net.parameters() if p.requires_grad), grads):
            p.grad = flat[at:at + g.numel()].view_as(g)
            at += g.numel()
        return float(flat[-1])

    def gather(self, items, path):
        """The leader gets the items of all, through files beside `path`; the others get an empty list."""
        if self.size == 1:
            return items
        if not self.leads:
            torch.save(items, f"{path}{self.rank}")
        dist.barrier()
        if not self.leads:
            return []
        for rank in range(1, self.size):
            items = items + torch.load(f"{path}{rank}", weights_only=False)
            os.remove(f"{path}{rank}")
        return items

    def close(self):
        """Waits for the helpers; an error of one is an error here."""
        if self.size > 1:
            dist.destroy_process_group()
            codes = [p.wait() for p in self.others]
            if any(codes):
                raise SystemExit(f"a helper process failed: exit codes {codes}")
