"""On the machine with the GPU: trains for some minutes in the background, waits, and leaves what is new in $OUT.

    python3 training/gpu/run.py --minutes 25 --size mid     # starts a training, or finds the one that runs, and waits --wait seconds
    python3 training/gpu/run.py --collect                   # only brings what has not been brought yet

The training is a process session of its own: it runs on between calls as long as the machine is held. It builds the corpus from
carry/data, trains every stage of `train.all` for its share of the minutes, and writes checkpoints. carry/start, when it is there, holds
checkpoints to go on from. What is brought back are averaged weights (f16), cut into parts of less than 16 MiB, at most four a call,
and logs; `unpack.py` puts them together.
"""
import argparse
import glob
import json
import lzma
import os
import shutil
import signal
import subprocess
import sys
import tarfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
PART, PARTS = 15 * 2**20, 4
SHARES = {"audio": 0.07, "vae": 0.2, "flow": 0.43, "flow-audio": 0.08, "student": 0.15, "decoder": 0.04}  # of the minutes after the corpus; caches take the rest
GIVEN = {
    "cuda": {"audio": "--batch 256", "vae": "--batch 128 --compile", "flow": "--batch 256 --compile", "flow-audio": "--batch 128 --live 32",
             "student": "--batch 128 --teach 64 --memory 4096", "decoder": "--batch 64"},
    "cpu": {"audio": "--batch 4", "vae": "--batch 4", "flow": "--batch 4", "flow-audio": "--batch 2 --live 1", "student": "--batch 4 --teach 4", "decoder": "--batch 2"},
}


def unpack(carry, place):
    """Puts what was carried where training looks for it."""
    for packed in sorted(glob.glob(os.path.join(carry, "data", "*.tar.xz"))):
        done = os.path.join(place, os.path.basename(packed) + ".done")
        if not os.path.exists(done):
            with lzma.open(packed) as f, tarfile.open(fileobj=f, mode="r|") as tar:
                tar.extractall(os.path.join(place, "data"), filter="data")
            open(done, "w").close()
    for path in glob.glob(os.path.join(carry, "start", "*")):
        there = os.path.join(place, "runs", os.path.basename(path))
        if not os.path.exists(there):
            shutil.copy(path, there)


def alive(place):
    """The number of the training's process, if it runs."""
    try:
        with open(os.path.join(place, "pid")) as f:
            pid = int(f.read())
        os.kill(pid, 0)
        with open(f"/proc/{pid}/stat") as f:
            return pid if f.read().rsplit(")", 1)[1].split()[0] != "Z" else None
    except (OSError, ValueError):
        return None


def work(args):
    """The training itself: the corpus, then each stage for its share of what is left of the minutes."""
    began = time.monotonic()
    line = [sys.executable, "-m", "visavis_train.train.all", "--data", os.path.join(args.place, "data"), "--work", args.place, "--size", args.size,
            "--hours", str(args.hours), "--seed", str(args.seed), "--processes", str(os.cpu_count()), "--keep-minutes", "1"]
    env = os.environ | {"PYTHONPATH": os.path.dirname(HERE), "PYTHONUNBUFFERED": "1"}
    subprocess.run([*line, "--until", "arrays"], check=True, env=env)
    if args.prepare:
        return
    left = args.minutes - (time.monotonic() - began) / 60
    finished = lambda stage: os.path.exists(os.path.join(args.place, "runs", f"{stage}.done"))
    total = sum(share for stage, share in SHARES.items() if not finished(stage)) + 1 - sum(SHARES.values())
    for stage, share in SHARES.items():
        line += ["--more", f"{stage}:--minutes {left * share / total:.3f} {GIVEN[args.device][stage]} --device {args.device}"]
    subprocess.run([*line, "--until", "decoder"], check=True, env=env)
    open(os.path.join(args.place, "finished"), "w").close()


def snapshot(place):
    """Cuts the averaged weights of every checkpoint that has changed since it was last cut into parts in PLACE/outbox."""
    from visavis_train.train import common
    from visavis_train.train.all import CHECKPOINTS
    outbox, known = os.path.join(place, "outbox"), os.path.join(place, "brought.json")
    brought = json.load(open(known)) if os.path.exists(known) else {}
    for stage, name in reversed(CHECKPOINTS.items()):
        path, done = os.path.join(place, "runs", name), os.path.exists(os.path.join(place, "runs", f"{stage}.done"))
        if not os.path.exists(path):
            continue
        state = common.load(path)
        mark = [state["step"], done]
        if brought.get(stage) == mark or (stage == "flow" and "flow-audio" in brought):
            continue
        common.save(os.path.join(place, "light.pt"), **common.light(state))
        with open(os.path.join(place, "light.pt"), "rb") as f:
            held = f.read()
        pieces = [held[i:i + PART] for i in range(0, len(held), PART)]
        for i, piece in enumerate(pieces):
            with open(os.path.join(outbox, f"{stage}.{state['step']}{'.done' if done else ''}.{i + 1}of{len(pieces)}"), "wb") as f:
                f.write(piece)
        brought[stage] = mark
    with open(known, "w") as f:
        json.dump(brought, f)


def collect(place, out):
    """Moves parts and logs to OUT; returns how many parts are left."""
    outbox = os.path.join(place, "outbox")
    os.makedirs(outbox, exist_ok=True)
    if not os.listdir(outbox):
        snapshot(place)
    parts = sorted(os.listdir(outbox), key=lambda name: os.path.getmtime(os.path.join(outbox, name)))
    for name in parts[:PARTS]:
        shutil.move(os.path.join(outbox, name), os.path.join(out, name))
    with tarfile.open(os.path.join(out, "logs.tar.gz"), "w:gz") as tar:
        for path in [os.path.join(place, "log"), *glob.glob(os.path.join(place, "runs", "*.json*"))]:
            if os.path.exists(path):
                tar.add(path, os.path.basename(path))
    return len(parts[PARTS:])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--minutes", type=float, default=25, help="length of the training, corpus and all")
    parser.add_argument("--size", default="mid")
    parser.add_argument("--hours", type=float, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--wait", type=float, default=540, help="seconds after which what there is is brought")
    parser.add_argument("--collect", action="store_true")
    parser.add_argument("--prepare", action="store_true", help="only build the corpus")
    parser.add_argument("--device", default="cuda", choices=GIVEN)
    parser.add_argument("--place", default="/tmp/visavis")
    parser.add_argument("--carry", default=os.path.join(HERE, "carry"))
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.work:
        return work(args)
    began, log = time.monotonic(), os.path.join(args.place, "log")
    os.makedirs(os.path.join(args.place, "runs"), exist_ok=True)
    finished = lambda: os.path.exists(os.path.join(args.place, "finished"))
    if not args.collect and not alive(args.place) and not finished():
        unpack(args.carry, args.place)
        with open(log, "a") as f:
            process = subprocess.Popen([sys.executable, os.path.abspath(__file__), *sys.argv[1:], "--work"], stdout=f, stderr=f, start_new_session=True)
        with open(os.path.join(args.place, "pid"), "w") as f:
            f.write(str(process.pid))
    at = os.path.getsize(log) if args.collect and os.path.exists(log) else 0
    while True:
        if os.path.exists(log):
            with open(log) as f:
                f.seek(at)
                print(f.read(), end="", flush=True)
                at = f.tell()
        if args.collect or not alive(args.place) or time.monotonic() - began > args.wait:
            break
        time.sleep(1)
    left = collect(args.place, os.environ["OUT"])
    state = "runs" if alive(args.place) else "finished" if finished() else "ended"
    print(f"training {state}; {left} parts are left to bring" + (": call with --collect" if left else ""))


if __name__ == "__main__":
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    main()
