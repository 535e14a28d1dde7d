"""Trains a row: what it works on, then the model; the rows are in `rows.py`.

    python -m visavis_train.rivals.train --row NAME --corpus DIR --cache runs/cache --out runs/rivals/NAME.pt --steps 1500 [--vae-steps 900] [--workers 2]

--cache is one of `train.cache` of that corpus, made with any VAE: roots, users and voices' features are taken from it. Rows with a VAE leave it and a cache
of its latents beside --out. --resume goes on with whatever of these is there. Further arguments after `--` go to the row's last trainer (`train.flow`).
"""
import argparse
import os

from ..train import common
from ..train.all import command, run
from ..train.sizes import SIZES
from ..train.team import RANK, Team
from . import offline, show
from .directions import COUNT
from .rows import FLOWS, OFFLINE, TRAINED, VAES, beside


def before(args):
    """[(name, checkpoint that can be resumed or None, what it leaves, module, arguments)] of what a row works on."""
    if args.row in OFFLINE:
        return []
    many, vae, cache = ["--threads", str(args.threads)], args.vae or beside(args.out, "vae.pt"), beside(args.out, "cache")
    out = []
    if args.row == "no-vae" and not args.vae:
        out.append(("directions", None, vae, "rivals.directions", ["--corpus", args.corpus, "--out", vae, "--count", str(args.count), *many]))
    many += ["--workers", str(args.workers)]
    if args.row in VAES and not args.vae:
        out.append(("vae", vae, None, "train.vae", ["--corpus", args.corpus, "--out", vae, "--size", args.size, "--steps", str(args.vae_steps), "--batch",
                                                    str(args.vae_batch), "--seed", str(args.seed), "--keep-minutes", str(args.keep_minutes), *VAES[args.row], *many]))
    last = os.path.join(cache, "val.pt")
    out.append(("cache", None, last, "train.cache", ["--corpus", args.corpus, "--vae", vae, "--features-of", args.cache, "--out", cache, "--device", "cpu", *many]))
    return out


def flow(args, further):
    """The flow's trainer on the row's own latents."""
    given = ["--cache", beside(args.out, "cache"), "--vae", args.vae or beside(args.out, "vae.pt"), "--out", args.out, "--size", args.size, "--steps", str(args.steps),
             "--batch", str(args.batch), "--blocks", str(args.blocks), "--seed", str(args.seed), "--keep-minutes", str(args.keep_minutes), "--lr", str(args.lr),
             "--threads", str(args.threads), "--workers", str(args.workers), *further]
    run("flow", command(args.out if args.resume else None, "train.flow", given))


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--row", required=True, choices=TRAINED)
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--cache", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--size", choices=SIZES, default="base")
    parser.add_argument("--vae", help="take this VAE instead of training one of --vae-steps")
    parser.add_argument("--vae-steps", type=int, default=900)
    parser.add_argument("--vae-batch", type=int, default=8)
    parser.add_argument("--blocks", type=int, help="of a training window [64; offline rows 115, all that they make at once]")
    parser.add_argument("--count", type=int, default=COUNT, help=f"directions of a block, where there is no VAE [{COUNT}]")
    parser.add_argument("--poses", type=int, default=1024, help="windows that a2p's codes are fitted to [1024]")
    common.arguments(parser, steps=1500, lr=1.2e-3, batch=16)
    args, further = parser.parse_known_args()
    further = further[1:] if further[:1] == ["--"] else further
    if further and args.row not in FLOWS:
        parser.error(f"unknown arguments: {' '.join(further)}")
    args.blocks = args.blocks or (115 if args.row in OFFLINE else 64)
    return args, further


def main():
    args, further = arguments()
    os.makedirs(os.path.dirname(args.out) or ".", exist_ok=True)
    if RANK not in os.environ:
        for name, checkpoint, left, module, given in before(args):
            if args.resume and left and os.path.exists(left):
                continue
            print(f"== {name}", flush=True)
            run(name, command(checkpoint if args.resume else None, module, given))
    if args.row in FLOWS:
        return flow(args, further)
    common.start_process(args)
    team = Team(args.workers)
    args.vae = args.vae or beside(args.out, "vae.pt")
    if args.row == "show":
        args.cache = beside(args.out, "cache")
        show.train(args, team)
    else:
        offline.train(args, team)


if __name__ == "__main__":
    main()
