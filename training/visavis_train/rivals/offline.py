"""Offline rivals: diffusion over a whole window, the way of the user and both voices known from its beginning to its end.

*MDM* (Tevet et al. 2022): one transformer tells the clean motion from noisy motion. *A2P* (Ng et al. 2024): first poses about once a second, as codes told one
after the other, then diffusion of the motion that goes through them.

Both are simplified: tokens of four frames along principal directions (`data.py`) instead of a frame each, with 1000 cosine steps of noise. MDM without its
losses on positions, velocities and feet; A2P without faces, its poses every 32 frames instead of 30, quantised by k-means on what is left over from
level to level instead of a learnt VQ-VAE, told by a transformer that knows the conditions up to the pose's own second.
"""
import torch
from torch import nn

from ..mospa import diffusion
from ..nets.vae import Affine
from ..train import common
from ..train.flow import x1_error
from ..train.loop import Loop
from ..train.sizes import SIZES
from .data import Whole, metric_of
from .nets import Offline, Speaker, Telling

EVERY, AT = 8, 4            # blocks from one given pose to the next, and which of the eight it is
LEVELS, CODES = 4, 256      # of a given pose
GUIDANCE = 1.5


class Levels(nn.Module):
    """Vectors as `levels` codes: each level's book is of what the levels before leave over. `scale` [D] says what counts."""

    def __init__(self, size, levels=LEVELS, codes=CODES):
        super().__init__()
        self.register_buffer("books", torch.zeros(levels, codes, size))
        self.register_buffer("scale", torch.ones(size))

    @torch.no_grad()
    def fit(self, x, scale, rounds=12):
        """k-means of x [N, D], level by level."""
        self.scale.copy_(scale)
        rest = x * scale
        for book in self.books:
            book.copy_(rest[torch.randint(len(rest), (len(book),))])
            for _ in range(rounds):
                near = self.nearest(rest, book)
                count = torch.bincount(near, minlength=len(book)).clamp(min=1)[:, None]
                mean = torch.zeros_like(book).index_add_(0, near, rest) / count
                book.copy_(torch.where(torch.bincount(near, minlength=len(book))[:, None] > 0, mean, book))
            rest = rest - book[self.nearest(rest, book)]
        return self

    @staticmethod
    def nearest(x, book):
        return (book.square().sum(-1) - 2 * x @ book.T).argmin(-1)

    def codes(self, x):
        """[..., D] -> [..., levels]."""
        rest, out = (x * self.scale).flatten(0, -2), []
        for book in self.books:
            out.append(self.nearest(rest, book))
            rest = rest - book[out[-1]]
        return torch.stack(out, -1).unflatten(0, x.shape[:-1])

    def vectors(self, codes):
        return sum(book[codes[..., i]] for i, book in enumerate(self.books)) / self.scale


def seconds(cond):
    """Conditions of the given poses: the mean of each eight blocks' [B, T / 8, ...]."""
    return cond.map(lambda x: x[:, :x.shape[1] // EVERY * EVERY].unflatten(1, (-1, EVERY)).mean(2))


def keys(given, count):
    """Given poses [B, S, D] among `count` tokens, each with its flag: [B, count, D + 1]."""
    out = torch.zeros(len(given), count, given.shape[-1] + 1)
    at = torch.arange(given.shape[1]) * EVERY + AT
    out[:, at, :-1], out[:, at, -1] = given, 1.0
    return out


def size_of(args):
    return SIZES[args.size]["flow"] | {"embed_latent": max(SIZES[args.size]["flow"]["embed_latent"], args.count)}


def speaker_size(flow):
    """The transformer that tells given poses is half as deep and wide as the diffusion."""
    return flow | {"layers": max(1, flow["layers"] // 2), "width": flow["width"] // 2}


def made(state):
    """Networks of a checkpoint's description: the diffusion, and for A2P the speaker and the codes' levels, else None; and the codec."""
    codec = Affine(len(state["mean"]), state["latent"])
    codec.load_state_dict(state["codec"])
    guided = "levels" in state
    net = Offline(state["latent"], state["audio"], keys=state["latent"] if guided else 0, **state["size"])
    speaker = Speaker(state["audio"], CODES, LEVELS, **speaker_size(state["size"])) if guided else None
    levels = Levels(state["latent"])
    if guided:
        levels.load_state_dict(state["levels"])
    return net, speaker, levels, (codec.eval(), state["mean"], state["std"])


def train(args, team):
    """`args.row`: "mdm" or "a2p"."""
    first = common.load(args.out) if args.resume else None
    codec = made(first)[3] if first else None
    data = team.first(lambda: Whole(args.corpus, args.cache, "train", codec, args.blocks, args.count, workers=args.workers))
    held = Whole(args.corpus, args.cache, "val", data.codec, args.blocks, args.count, 0.0)
    metric = metric_of(data.codec[0])
    state = {k: first[k] for k in ("size", "latent", "audio", "codec", "mean", "std", "levels", "row") if k in first} if first else None
    if state is None:
        state = {"row": args.row, "size": size_of(args), "latent": args.count, "audio": data.windows.audio_features, "codec": data.codec[0].state_dict(),
                 "mean": data.codec[1], "std": data.codec[2]}
        if args.row == "a2p":
            poses = torch.cat([data.batch(32)[0][:, AT::EVERY].flatten(0, 1) for _ in range(max(1, args.poses // 32))])
            state["levels"] = Levels(args.count).fit(poses, (0.5 + 0.5 * metric.diagonal()).sqrt()).state_dict()
    torch.manual_seed(args.seed)        # the same weights in all processes
    net, speaker, levels, _ = made(state)
    loop = Loop(team, net, args, average=0.998, beside={"speaker": speaker} if speaker else None, **state)

    def losses(net, speaker, z, cond, t, noise):
        """The diffusion's error, and the speaker's in nats a code."""
        given, told = None, {}
        if speaker:
            poses = z[:, :len(z[0]) // EVERY * EVERY][:, AT::EVERY]
            codes = levels.codes(poses)
            given, told = keys(levels.vectors(codes), z.shape[1]), {"told": speaker.loss(codes, seconds(cond))}
        with common.mixed(z.device):
            error = x1_error(net(diffusion.noised(z, t, noise), t, cond, given), z, metric).mean()
        return {"clean": error} | told

    @torch.no_grad()
    def measure(net):
        torch.manual_seed(1)
        z, cond = held.batch(16)
        told = loop.averages["speaker"].net if speaker else None
        each = {f"val{t}": losses(net, told, z, cond, torch.full((16,), t), torch.randn_like(z)) for t in (999, 500)}
        return {k: v["clean"].item() for k, v in each.items()} | ({"valtold": each["val500"]["told"].item()} if speaker else {})

    for _ in loop:
        z, cond = data.batch(args.batch)
        # Half of the time at the steps that decide what happens: below them noisy tokens tell each other.
        t = torch.where(torch.rand(len(z)) < 0.5, 800 + 200 * torch.rand(len(z)), 1000 * torch.rand(len(z))).long()
        parts = losses(net, speaker, z, cond, t, torch.randn_like(z))
        loop.update(sum(parts.values()), **parts)
        loop.report(100, measure, 500)
    loop.finish(measure)


@torch.no_grad()
def generate(path, cond, seed=0, steps=50, guidance=GUIDANCE, temperature=1.0):
    """Tokens [B, T, D] under conditions of whole windows, and the codec."""
    state = common.load(path)
    net, speaker, levels, codec = made(state)
    net.load_state_dict(state["ema"])
    net.eval()
    generator, given = torch.Generator().manual_seed(seed), None
    count = cond.flags.shape[1]
    if speaker:
        speaker.load_state_dict(state["beside"]["speaker"]["ema"])
        telling, every = Telling(speaker.eval(), generator, temperature), seconds(cond)
        codes = [telling.step(every.at(slice(k, k + 1))) for k in range(every.flags.shape[1])]
        given = keys(levels.vectors(torch.cat(codes, 1)), count)
    free = cond.dropped()

    def clean(x, t):
        told, blind = net(x, t, cond, given), net(x, t, free, given)
        return blind + guidance * (told - blind)

    return diffusion.sample(clean, torch.randn(len(cond.flags), count, state["latent"], generator=generator), steps), codec
