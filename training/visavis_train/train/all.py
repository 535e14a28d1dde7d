"""From real parts to a bundle in one command; call it again to go on where it was interrupted.

    python -m visavis_train.train.all --data DATA --work WORK [--size base] [--hours 20] [--scale 1] [--workers 1] [--start B.safetensors]

WORK gets corpus/, runs/ (checkpoints with their arguments and logs, curves) and the bundles SIZE-f32.safetensors and SIZE-f16.safetensors. With
clips of one's own in WORK/corpus/{train,val,test} the corpus is left as it is. Each finished stage leaves runs/STAGE.done; delete it to have a stage
done again. Lengths are steps: the same seed, steps and number of workers give the same model on one machine, however often it is interrupted.
"""
import argparse
import glob
import os
import shlex
import signal
import subprocess
import sys

from ..corpus.voices import SPLITS
from .sizes import SIZES

# Steps at --scale 1.
STEPS = {
    "base": {"audio": 2000, "vae": 6000, "flow": 30000, "flow-audio": 1000, "student": 3000, "decoder": 600},
    "mid": {"audio": 3000, "vae": 8000, "flow": 60000, "flow-audio": 1500, "student": 4000, "decoder": 600},
    "paper": {"audio": 3000, "vae": 20000, "flow": 100000, "flow-audio": 2000, "student": 6000, "decoder": 1000},
}
CHECKPOINTS = {"audio": "audio.pt", "vae": "vae.pt", "flow": "flow.pt", "flow-audio": "flow-audio.pt", "student": "student.pt", "decoder": "vae-fine.pt"}
TRAINED = tuple(CHECKPOINTS)


def stages(a):
    """[(name, checkpoint that can be resumed or None, module, arguments)] in order."""
    runs, corpus = os.path.join(a.work, "runs"), os.path.join(a.work, "corpus")
    at = lambda name: os.path.join(runs, name)
    if not a.data and not a.start:
        raise SystemExit("--data is needed: the audio encoder trains on DATA/speech (or give --start, and its audio encoder is kept)")
    alone = at(CHECKPOINTS["audio"]) if a.data else os.path.join(runs, "start", "audio.pt")
    heard, many = at("cache-audio"), ["--threads", str(a.threads), "--workers", str(a.workers)]
    start = lambda name: ["--init", os.path.join(runs, "start", f"{name}.pt")] if a.start else []
    length = lambda name: ["--steps", str(max(1, round(STEPS[a.size][name] * a.scale))), "--seed", str(a.seed), "--keep-minutes", str(a.keep_minutes)]
    kept = {name: at(file) for name, file in CHECKPOINTS.items()}
    flow = kept["flow-audio"]
    train = lambda name, *given: (name, kept[name], "train." + {"flow-audio": "flow"}.get(name, name),
                                  ["--out", kept[name], *given, *length(name), *many, *shlex.split(dict(a.more).get(name, ""))])
    out = []
    if a.data and not glob.glob(os.path.join(corpus, "train", "*.safetensors")):
        out.append(("corpus", None, "corpus", ["--data", a.data, "--out", corpus, "--hours", str(a.hours), "--workers", str(a.processes or a.workers)]))
    if a.start:
        out.append(("start", None, "checkpoints", ["--bundle", a.start, "--out", at("start")]))
    out.append(("arrays", None, "train.data", ["--corpus", corpus, "--workers", str(a.processes or a.workers)]))
    if a.data:
        out.append(train("audio", "--speech", os.path.join(a.data, "speech"), "--size", a.size, "--only", ",".join(SPLITS["train"]),
                         "--validate", ",".join(SPLITS["val"]), *start("audio")))
    out += [
        train("vae", "--corpus", corpus, "--size", a.size, *start("vae")),
        ("cache", None, "train.cache", ["--corpus", corpus, "--vae", kept["vae"], "--audio", alone, "--out", at("cache"), *many]),
        train("flow", "--cache", at("cache"), "--vae", kept["vae"], "--size", a.size, *start("flow")),
        train("flow-audio", "--cache", at("cache"), "--vae", kept["vae"], "--init", kept["flow"], "--end-to-end", alone, "--corpus", corpus,
              "--live", "4", "--batch", "16", "--lr", "3e-4"),
        ("relisten", None, "train.cache", ["--latents-of", at("cache"), "--corpus", corpus, "--audio", flow, "--out", heard, *many]),
        train("student", "--cache", heard, "--vae", kept["vae"], "--flow", flow),
        train("decoder", "--corpus", corpus, "--cache", heard, "--vae", kept["vae"], "--flow", flow, "--student", kept["student"]),
    ]
    out.append(("curves", None, "train.curves", [checkpoint + ".jsonl" for name, checkpoint, *_ in out if name in TRAINED] + ["--out", at("curves")]))
    for kind, extra in (("f32", []), ("f16", ["--half"])):
        out.append((f"export-{kind}", None, "export", ["--corpus", corpus, "--audio", flow, "--vae", kept["decoder"], "--flow", flow, "--student", kept["student"],
                                                       "--name", a.size, "--out", os.path.join(a.work, f"{a.size}-{kind}.safetensors"), *extra]))
    return out


def command(checkpoint, module, arguments):
    """The stage's command line; a checkpoint that is there is resumed, and what it started from is no longer asked for."""
    if checkpoint and os.path.exists(checkpoint):
        if "--init" in arguments:
            k = arguments.index("--init")
            arguments = arguments[:k] + arguments[k + 2:]
        arguments = [*arguments, "--resume"]
    return [sys.executable, "-m", f"visavis_train.{module}", *arguments]


def pair(text):
    """"flow:--late 1" -> ("flow", "--late 1")."""
    name, _, given = text.partition(":")
    if name not in TRAINED:
        raise argparse.ArgumentTypeError(f"{name!r} is none of {', '.join(TRAINED)}")
    return name, given


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--work", required=True)
    parser.add_argument("--data", help="folder with motion/ and speech/; not needed with clips in WORK/corpus and --start, whose audio encoder is kept")
    parser.add_argument("--hours", type=float, default=20.0)
    parser.add_argument("--size", choices=SIZES, default="base")
    parser.add_argument("--scale", type=float, default=1.0, help="factor on every stage's steps")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1, help="processes of a stage")
    parser.add_argument("--processes", type=int, help="processes of the stages that train nothing; default --workers")
    parser.add_argument("--keep-minutes", type=float, default=4.0, help="time between checkpoints")
    parser.add_argument("--start", help="bundle of the same size whose weights to start from")
    parser.add_argument("--more", type=pair, action="append", default=[], metavar="STAGE:ARGUMENTS", help="further arguments of a stage")
    parser.add_argument("--until", metavar="STAGE", help="stop after this stage")
    parser.add_argument("--list", action="store_true", help="print the commands and stop")
    a = parser.parse_args()
    runs = os.path.join(a.work, "runs")
    os.makedirs(runs, exist_ok=True)
    for name, checkpoint, module, arguments in stages(a):
        done, line = os.path.join(runs, f"{name}.done"), command(checkpoint, module, arguments)
        if a.list:
            print(shlex.join(line[1:]))
        elif not os.path.exists(done):
            print(f"== {name}", flush=True)
            run(name, line)
            open(done, "w").close()
        if name == a.until:
            return


def run(name, line):
    """Runs a stage; a signal to stop is handed on to it, and it keeps where it stands."""
    process = subprocess.Popen(line, start_new_session=True)
    for s in (signal.SIGTERM, signal.SIGINT):
        signal.signal(s, lambda *_: process.send_signal(signal.SIGTERM))
    code = process.wait()
    if code == 128 + signal.SIGTERM:
        raise SystemExit("stopped; the same command goes on")
    if code:
        raise SystemExit(f"stage {name} failed; the command was: {shlex.join(line[1:])}")


if __name__ == "__main__":
    main()
