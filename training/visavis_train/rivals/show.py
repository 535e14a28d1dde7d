"""A rival that works on codes: a VQ-VAE of motion and a causal transformer that tells its codes block by block, as SHOW does (Yi et al. 2023).

Simplified: one VQ-VAE of the whole body (`train.vae --plain --codes 256`, four codes a block) instead of one for the body and one for the hands, which
this rig has none of; no face; blocks of four frames. SHOW hears the agent alone; this one is given what the others are: both voices, the user, a gaze score.
"""
import os

import torch

from ..nets.flow import absent
from ..nets.stream import decoding
from ..train import common
from ..train.cache import load_vae
from ..train.loop import Loop
from ..train.rollout import walk
from ..train.sizes import SIZES
from ..train.windows import Windows
from .nets import Speaker, Telling


def made(state):
    return Speaker(state["audio"], state["codes"], state["groups"], **state["size"])


def train(args, team):
    vae = load_vae(args.vae)[0]
    if vae.quantiser is None:
        raise SystemExit(f"{args.vae} has no codes: train it with --codes")
    train, held = (Windows(os.path.join(args.cache, split + ".pt"), args.blocks, *given) for split, given in (("train", ()), ("val", (0, 0, 0, 0, False))))
    codes = lambda w, z: vae.quantiser.codes(z * w.std + w.mean)
    first = common.load(args.out) if args.resume else None
    state = {k: first[k] for k in ("row", "size", "audio", "codes", "groups")} if first else {
        "row": args.row, "size": SIZES[args.size]["flow"], "audio": train.audio_features, "codes": vae.quantiser.books.shape[1], "groups": vae.quantiser.GROUPS}
    torch.manual_seed(args.seed)
    net = made(state)
    loop = Loop(team, net, args, average=0.998, **state)

    @torch.no_grad()
    def measure(net):
        torch.manual_seed(1)
        z, cond = held.batch(16)
        seen = codes(held, z)
        odds = torch.stack([torch.bincount(seen[..., g].flatten(), minlength=state["codes"]) for g in range(state["groups"])]) / seen[..., 0].numel()
        return {"val": net.loss(seen, cond).item(), "used": (-(odds * (odds + 1e-9).log()).sum(-1)).exp().mean().item()}

    for _ in loop:
        z, cond = train.batch(args.batch)
        with common.mixed(z.device):
            loss = net.loss(codes(train, z), cond)
        loop.update(loss, train=loss)
        loop.report(100, measure, 500)
    loop.finish(measure)


@torch.no_grad()
def generate(path, vae_path, batch, idle, target=None, seed=0, temperature=1.0):
    """Feature vectors and roots of clips (`rollout.Batch`), from the idle frames [4 M, F] on."""
    state = common.load(path)
    net = made(state)
    net.load_state_dict(state["ema"])
    vae, mean, std, _ = load_vae(vae_path)
    telling, decode, n = Telling(net.eval(), torch.Generator().manual_seed(seed), temperature), decoding(vae.decoder), len(batch)
    frames = lambda codes: decode(vae.quantiser.vectors(codes)) * std + mean
    begun = vae.quantiser.codes(vae.encoder(((idle - mean) / std)[None])[0]).expand(n, -1, -1)
    for k in range(begun.shape[1]):
        frames(telling.step(absent(n, 1, state["audio"]), begun[:, k:k + 1]))
    return walk(lambda cond: frames(telling.step(cond)), batch, target)
