"""From real parts to a bundle in one command; call it again to go on where it was interrupted.

    python -m visavis_train.train.all --data DATA --work WORK [--hours 20] [--scale 1] [--workers 1] [--start B.safetensors]

WORK gets corpus/, runs/ (checkpoints, logs, curves) and the bundles base-f32.safetensors and base-f16.safetensors. With clips of one's own in
WORK/corpus/{train,val,test} the corpus is left as it is. Each finished stage leaves runs/STAGE.done; delete it to have a stage done again.
"""
import argparse
import glob
import os
import subprocess
import sys

from ..corpus.voices import SPLITS

# Minutes at --scale 1, for one worker with a core of its own.
MINUTES = {"audio": 15, "vae": 60, "flow": 75, "flow-audio": 25, "student": 30, "decoder": 20}


def stages(a):
    """[(name, checkpoint that can be resumed or None, module, arguments)] in order."""
    runs, corpus = os.path.join(a.work, "runs"), os.path.join(a.work, "corpus")
    at = lambda name: os.path.join(runs, name)
    if not a.data and not a.start:
        raise SystemExit("--data is needed: the audio encoder trains on DATA/speech (or give --start, and its audio encoder is kept)")
    alone = at("audio.pt") if a.data else os.path.join(runs, "start", "audio.pt")
    flow, audio, heard = at("flow-audio.pt"), at("flow-audio.pt.audio"), at("cache-audio")
    length = lambda name: ["--minutes", str(MINUTES[name] * a.scale)]
    many = ["--threads", str(a.threads), "--workers", str(a.workers)]
    start = lambda name: ["--init", os.path.join(runs, "start", f"{name}.pt")] if a.start else []
    out = []
    if a.data and not glob.glob(os.path.join(corpus, "train", "*.safetensors")):
        out.append(("corpus", None, "corpus", ["--data", a.data, "--out", corpus, "--hours", str(a.hours), "--workers", str(a.workers)]))
    if a.start:
        out.append(("start", None, "checkpoints", ["--bundle", a.start, "--out", at("start")]))
    if a.data:
        out.append(("audio", None, "train.audio", ["--speech", os.path.join(a.data, "speech"), "--out", alone, "--threads", str(a.threads),
                                                   "--only", ",".join(SPLITS["train"]), "--validate", ",".join(SPLITS["val"]), *length("audio"), *start("audio")]))
    out += [
        ("vae", at("vae.pt"), "train.vae", ["--corpus", corpus, "--out", at("vae.pt"), "--size", a.size, *length("vae"), *many, *start("vae")]),
        ("cache", None, "train.cache", ["--corpus", corpus, "--vae", at("vae.pt"), "--audio", alone, "--out", at("cache"),
                                        "--threads", str(a.threads), "--waves"]),
        ("flow", at("flow.pt"), "train.flow", ["--cache", at("cache"), "--vae", at("vae.pt"), "--out", at("flow.pt"), "--size", a.size,
                                               *length("flow"), *many, *start("flow")]),
        ("flow-audio", at("flow-audio.pt"), "train.flow", ["--cache", at("cache"), "--vae", at("vae.pt"), "--out", at("flow-audio.pt"), "--init", at("flow.pt"),
                                                           "--end-to-end", alone, "--live", "4", "--batch", "16", "--lr", "3e-4", *length("flow-audio"), *many]),
        ("relisten", None, "train.cache", ["--relisten", at("cache"), "--corpus", corpus, "--audio", audio, "--out", heard, "--threads", str(a.threads)]),
        ("student", at("student.pt"), "train.student", ["--cache", heard, "--vae", at("vae.pt"), "--flow", flow,
                                                        "--out", at("student.pt"), *length("student"), *many]),
        ("decoder", at("vae-fine.pt"), "train.decoder", ["--corpus", corpus, "--cache", heard, "--vae", at("vae.pt"), "--flow", flow,
                                                         "--student", at("student.pt"), "--out", at("vae-fine.pt"), *length("decoder"), *many]),
        ("curves", None, "train.curves", [at(f"{n}.pt.jsonl") for n in (*(("audio",) if a.data else ()), "vae", "flow", "flow-audio", "student", "vae-fine")] + ["--out", at("curves")]),
    ]
    for kind, extra in (("f32", []), ("f16", ["--half"])):
        out.append((f"export-{kind}", None, "export", ["--corpus", corpus, "--audio", audio, "--vae", at("vae-fine.pt"), "--flow", flow,
                                                       "--student", at("student.pt"), "--out", os.path.join(a.work, f"base-{kind}.safetensors"), *extra]))
    return out


def command(checkpoint, module, arguments):
    """The stage's command line; a checkpoint that is there is resumed, and what it started from is no longer asked for."""
    if checkpoint and os.path.exists(checkpoint):
        if "--init" in arguments:
            k = arguments.index("--init")
            arguments = arguments[:k] + arguments[k + 2:]
        arguments = [*arguments, "--resume"]
    return [sys.executable, "-m", f"visavis_train.{module}", *arguments]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--work", required=True)
    parser.add_argument("--data", help="folder with motion/ and speech/; not needed with clips in WORK/corpus and --start, whose audio encoder is kept")
    parser.add_argument("--hours", type=float, default=20.0)
    parser.add_argument("--scale", type=float, default=1.0, help="factor on every stage's minutes")
    parser.add_argument("--size", choices=("base", "paper"), default="base")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1, help="processes of a stage")
    parser.add_argument("--start", help="bundle of the same size whose weights to start from")
    parser.add_argument("--list", action="store_true", help="print the commands and stop")
    a = parser.parse_args()
    runs = os.path.join(a.work, "runs")
    os.makedirs(runs, exist_ok=True)
    for name, checkpoint, module, arguments in stages(a):
        done, line = os.path.join(runs, f"{name}.done"), command(checkpoint, module, arguments)
        if a.list:
            print(" ".join(line[1:]))
            continue
        if os.path.exists(done):
            continue
        print(f"== {name}", flush=True)
        if subprocess.run(line).returncode:
            raise SystemExit(f"stage {name} failed; the command was: {' '.join(line[1:])}")
        open(done, "w").close()


if __name__ == "__main__":
    main()
