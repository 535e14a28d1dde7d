"""Trains what the agent makes of what it hears: which reaction a sound calls for, frame by frame, and for how long.

    python -m visavis_train.hearing.appraise --corpus WORK/hearing --cache runs/cache-hearing --out runs/appraisal.pt

An LSTM over the encoder's features, both levels and the sensitivity. The flow is told its answer (shares of the reactions) beside what it was made
of: left to find this out by itself, from some thousand sounds and through the noise of its own tokens, it turned to the right place and did the wrong thing.
"""
import argparse
import json
import os

import torch
import torch.nn.functional as F

from ..corpus import store
from ..mospa.react import REACTIONS
from ..nets.appraisal import Appraisal
from ..train import common
from ..train.loop import Loop
from ..train.team import Team

FRAMES = 360
LEAVE = 4          # frames after a sound's onset, and after a reaction's end, in which either answer will do


def load(path):
    state = common.load(path)
    net = Appraisal(state["features"], state["reactions"], state["width"])
    net.load_state_dict(state["ema"])
    return net.eval()


class Streams:
    """Stretches of a split's clips, or of rooms: input rows, reactions and how much each frame counts."""

    def __init__(self, state, events):
        """`state`: `starts`, `sound`, `levels`, `sensitivity` of a cache or of rooms; `events`: of each clip."""
        self.starts, self.levels, self.sensitivity = state["starts"], state["levels"], state["sensitivity"]
        self.sound = state["sound"]
        self.label = torch.zeros(int(self.starts[-1]), dtype=torch.long)
        self.count = torch.ones(int(self.starts[-1]))
        for i, of_clip in enumerate(events):
            first, after = int(self.starts[i]), int(self.starts[i + 1])
            for e in of_clip:
                a, b = first + e["onset"], min(first + max(e["until"], e["onset"]), after)
                self.label[a:b] = REACTIONS.index(e["reaction"])
                heard = slice(a, min(max(first + e["end"], b), after))
                self.count[heard] = 4.0                 # most frames are of a quiet room
                self.count[a:a + LEAVE] = 0
                self.count[b:min(b + 2 * LEAVE, after)] = 0

    @classmethod
    def of_corpus(cls, corpus, cache, split):
        state = common.load(os.path.join(cache, split + ".pt"), mmap=True)
        return cls(state, [json.loads(store.load(os.path.join(corpus, split, name), False).meta["events"]) for name in state["names"]])

    @classmethod
    def of_rooms(cls, path):
        state = common.load(path)
        return cls(state, json.loads(state["events"]))

    def batch(self, size, generator=None):
        rows = torch.randint(len(self.starts) - 1, (size,), generator=generator)
        at = self.starts[rows] + (torch.rand(size, generator=generator) * (self.starts[rows + 1] - self.starts[rows] - FRAMES).clamp(min=0)).long()
        where = (at[:, None] + torch.arange(FRAMES)).clamp(max=len(self.label) - 1)
        sensitivity = self.sensitivity[rows][:, None, None].expand(-1, FRAMES, 1)
        x = torch.cat([self.sound[where].float(), self.levels[where], sensitivity], -1)
        # A stream does not know what sounded before it began.
        begun = (self.label[where] == 0).cumsum(1) > 0
        return x, self.label[where], self.count[where] * begun


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--corpus", required=True, help="folder of visavis_train.hearing.corpus")
    parser.add_argument("--cache", required=True, help="its cache, made with --hearing")
    parser.add_argument("--rooms", help="half of each batch is of these (`hearing.rooms`)")
    parser.add_argument("--out", required=True)
    common.arguments(parser, steps=900, lr=3e-3, batch=32)
    args = parser.parse_args()
    common.start_process(args)
    team = Team(args.workers)
    train, held = Streams.of_corpus(args.corpus, args.cache, "train"), Streams.of_corpus(args.corpus, args.cache, "val")
    rooms = Streams.of_rooms(args.rooms) if args.rooms else None
    net = Appraisal(train.sound.shape[1], REACTIONS)
    loop = Loop(team, net, args, warmup=50, average=0.99, features=train.sound.shape[1], reactions=list(REACTIONS), width=net.width)
    check = held.batch(192, torch.Generator().manual_seed(1))

    @torch.no_grad()
    def measure(net):
        x, label, count = check
        told = net.told(x).argmax(-1)
        quiet = (label == 0) & (count == 1)
        share = lambda hit, of: (hit.float() * of.float()).sum().item() / of.float().sum().item()
        return {"right": share(told == label, count * (label > 0)), "alarms": share(told > 0, quiet)}

    for _ in loop:
        x, label, count = train.batch(args.batch)
        if rooms:
            half = args.batch // 2
            x, label, count = (torch.cat([a[half:], b]) for a, b in zip((x, label, count), rooms.batch(half)))
        x = x + 0.1 * torch.randn_like(x)
        told = net.told(F.dropout(x, 0.1))
        loss = (F.cross_entropy(told.flatten(0, 1), label.flatten(), reduction="none") * count.flatten()).sum() / count.sum()
        loop.update(loss, train=loss)
        loop.report(100, measure)
    loop.finish(measure)


if __name__ == "__main__":
    main()
