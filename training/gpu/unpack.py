"""Puts together what `run.py` brought: python training/gpu/unpack.py FILES... --work WORK

FILES are all files of all calls (a folder stands for what is in it). Of each stage the newest checkpoint of which every part is there goes to WORK/runs,
with the logs; `train.all --work WORK` or `export` go on from there.
"""
import argparse
import os
import re
import tarfile

NAME = re.compile(r"(?P<stage>[a-z-]+)\.(?P<step>\d+)(?P<done>\.done)?\.(?P<i>\d+)of(?P<n>\d+)$")
CHECKPOINTS = {"audio": "audio.pt", "vae": "vae.pt", "flow": "flow.pt", "flow-audio": "flow-audio.pt", "student": "student.pt", "decoder": "vae-fine.pt"}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("files", nargs="+")
    parser.add_argument("--work", required=True)
    args = parser.parse_args()
    runs = os.path.join(args.work, "runs")
    os.makedirs(runs, exist_ok=True)
    every = [p for f in args.files for p in ([os.path.join(f, n) for n in os.listdir(f)] if os.path.isdir(f) else [f])]
    sets = {}
    for path in every:
        if path.endswith("logs.tar.gz"):
            with tarfile.open(path) as tar:
                tar.extractall(runs, filter="data")
        elif m := NAME.match(os.path.basename(path)):
            sets.setdefault((m["stage"], int(m["step"]), bool(m["done"]), int(m["n"])), {})[int(m["i"])] = path
    newest = {}
    for (stage, step, done, count), parts in sorted(sets.items()):
        if len(parts) == count:
            newest[stage] = step, done, [parts[i] for i in range(1, count + 1)]
        else:
            print(f"{stage} at step {step}: {len(parts)} of {count} parts, left out")
    for stage, (step, done, parts) in newest.items():
        out = os.path.join(runs, CHECKPOINTS[stage])
        with open(out + ".tmp", "wb") as whole:
            for path in parts:
                with open(path, "rb") as f:
                    whole.write(f.read())
        os.replace(out + ".tmp", out)
        if done:
            open(os.path.join(runs, f"{stage}.done"), "w").close()
        print(f"{out}: step {step}, {'finished' if done else 'under way'}, {os.path.getsize(out) / 2**20:.1f} MiB")


if __name__ == "__main__":
    main()
