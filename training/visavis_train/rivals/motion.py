"""What a row makes of the evaluation's windows: a clip for each, for `visavis eval --row NAME=FOLDER`.

    python -m visavis_train.rivals.motion --row NAME --net runs/rivals/NAME.pt --audio runs/audio.pt --corpus DIR --windows KEPT --out KEPT/NAME

KEPT is what `visavis eval --keep KEPT` left. Models that go on from block to block begin 2 s before what is measured, where the clip's agent stands then, from
somebody at rest of the corpus' train split; offline rows make these 2 s and the window at once.
"""
import argparse
import os
import time

import torch

from .. import bundle as bundles
from .. import export
from ..train.cache import form_of, load_audio, load_vae
from ..train.data import load_motion
from ..train.flow import load_flow
from ..train.forms import ICOSAHEDRA
from ..train.rollout import Batch, roll
from . import body, data, offline, place, show
from .rows import FLOWS, OFFLINE, ROWS, beside

SPAN = (place.LEAD + place.MEASURED) // 4


def at_rest(corpus, frames=64):
    """Compact frames of somebody who stands still."""
    name, at = export.idle_clip(corpus, "train", frames)[1].rsplit(":", 1)
    return load_motion(os.path.join(corpus, "train", name))[1][int(at):int(at) + frames]


def as_bundle(args, idle):
    """A flow and its VAE as `rollout.roll` takes them, and what a frame is to them."""
    vae, mean, std, kept = load_vae(args.vae)
    net, state = load_flow(args.net)
    session = bundles.SESSION | {k: v for k, v in (("guidance", args.guidance), ("temperature", args.temperature)) if v is not None}
    session["gaze_guidance"] = args.gaze_guidance or (1.0 if args.row == "gaze-1" else session["gaze_guidance"])
    tensors = {"stats.pose_mean": mean, "stats.pose_std": std, "stats.latent_mean": state["latent_mean"], "stats.latent_std": state["latent_std"],
               "idle.frames": form_of(kept).of(idle)}
    config = {"session": session, "vae": {"latent": state["latent"]}, "audio": {"features": state["audio"]}}
    return bundles.Bundle(config, tensors, None, vae, net, None, None, None), form_of(kept)


def maker(args):
    """(batch, seed) -> features [B, T, F] and roots [B, T, 3], and what a frame is."""
    if args.row in OFFLINE:
        def make(batch, seed):
            has = torch.cat([torch.ones(len(batch), 1), batch.has], 1)
            gaze = None if args.gaze is None else torch.full((len(batch),), args.gaze)
            cond = data.asked(batch.user[..., [0, 2]].float(), batch.agent, batch.voice, has, gaze)
            guided = {} if args.guidance is None else {"guidance": args.guidance}
            z, codec = offline.generate(args.net, cond, seed, args.steps, temperature=args.temperature or 1.0, **guided)
            return data.decoded(codec, z)
        return make, ICOSAHEDRA
    idle = at_rest(args.corpus)
    if args.row == "show":
        rest = ICOSAHEDRA.of(idle)
        return lambda batch, seed: show.generate(args.net, args.vae, batch, rest, args.gaze, seed, args.temperature or 1.0), ICOSAHEDRA
    b, form = as_bundle(args, idle)
    return lambda batch, seed: roll(b, batch, args.gaze, seed=seed), form


@torch.no_grad()
def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--row", required=True, choices=ROWS)
    parser.add_argument("--net", required=True, help="checkpoint of rivals.train, or any flow's")
    parser.add_argument("--vae", help="its VAE [the one beside it]")
    parser.add_argument("--audio", required=True, help="the audio encoder of the features that it was trained on")
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--split", default="test", help="of the windows' clips")
    parser.add_argument("--windows", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--gaze", type=float, help="gaze target [none]")
    parser.add_argument("--gaze-guidance", type=float, help=f"[{bundles.SESSION['gaze_guidance']:g}, of gaze-1 1]")
    parser.add_argument("--guidance", type=float, help=f"[{bundles.SESSION['guidance']:g}]")
    parser.add_argument("--temperature", type=float, help=f"of the noise [{bundles.SESSION['temperature']:g}]; of show's and a2p's codes [1]")
    parser.add_argument("--steps", type=int, default=50, help="of offline diffusion [50]")
    parser.add_argument("--batch", type=int, default=16, help="windows at a time")
    parser.add_argument("--limit", type=int, help="take at most this many windows")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    if args.row == "gaze-1" and args.gaze is None:
        parser.error("gaze guidance tells nothing without --gaze")
    if args.row in (*FLOWS, "gaze-1", "show"):
        args.vae = args.vae or beside(args.net, "vae.pt")
    audio, (make, form) = load_audio(args.audio), maker(args)
    every, spent = place.windows(args.windows, os.path.join(args.corpus, args.split))[:args.limit], 0.0
    for k in range(0, len(every), args.batch):
        some = every[k:k + args.batch]
        clips, starts = zip(*(place.cut(w) for w in some))
        batch, began = Batch(audio, clips, SPAN), time.monotonic()
        x, roots = make(batch, 1000003 * args.seed + k)
        spent += time.monotonic() - began
        for i, window in enumerate(some):
            place.write(args.out, args.row, window, *body.motion(form, x[i], roots[i]), starts[i])
    print(f"{args.row}: {len(every)} windows, {len(every) * 4 * SPAN / spent:.0f} frames/s with {args.threads} threads, {args.batch} windows at a time")


if __name__ == "__main__":
    main()
