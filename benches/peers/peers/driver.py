"""Starts workers, has them compute in turn, keeps what they say."""
import json
import os
import statistics
import subprocess
import sys
import time

import numpy as np
from safetensors import safe_open

from .plain import read

OURS = {"visavis-f32": "f32", "visavis-i8": "i8", "visavis-i4": "i4"}
PYTHON = ["ort-f32", "ort-i8", "ort-i4", "openvino-f32", "openvino-i8", "openvino-static", "openvino-i4", "torch-f32", "torch-i8", "ggml-q8", "ggml-q4"]
RUST = ["tract-f32", "candle-f32", "candle-q8", "candle-q4"]
# Ours attends over 100 blocks only when as many are past; peers' shapes are fixed.
WARM_OURS, WARM = 104, 6
TOLERANCE = 1e-3


def chosen(only):
    everyone = [*OURS, *PYTHON, *RUST]
    starts = [s for s in only.split(",") if s]
    return [n for n in everyone if not starts or any(n.startswith(s) for s in starts)]


def command(folder, name, threads, cache="f16"):
    binary = os.environ["VISAVIS_PEERS_BIN"]
    if name in OURS:
        return [f"{binary}/ours", "serve", f"{folder}/{OURS[name]}.safetensors", f"{folder}/inputs.safetensors", str(threads), "midpoint4", cache]
    if name in RUST:
        return [f"{binary}/{name.split('-')[0]}", folder, name, str(threads)]
    return [sys.executable, "-m", "peers.worker", folder, name, str(threads)]


class Worker:
    def __init__(self, folder, name, threads, cache="f16"):
        self.name = name
        env = dict(os.environ, OMP_NUM_THREADS=str(threads), MKL_NUM_THREADS=str(threads), RAYON_NUM_THREADS=str(threads), TOKENIZERS_PARALLELISM="false")
        self.log = open(f"{folder}/{name}.log", "w")
        self.process = subprocess.Popen(command(folder, name, threads, cache), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.log, text=True, env=env)

    def wait(self):
        return self.answer()

    def ask(self, **what):
        self.process.stdin.write(json.dumps(what) + "\n")
        self.process.stdin.flush()
        return self.answer()

    def answer(self):
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError(f"{self.name} ended; see {self.log.name}")
        return json.loads(line)

    def close(self):
        self.process.stdin.close()
        self.process.wait()
        self.log.close()


def flat(path):
    with safe_open(path, framework="np") as f:
        return {k: f.get_tensor(k).reshape(-1) for k in ("latents", "decoded")}


def check(args):
    """Everyone runs the prepared blocks, each on its own history; f32 peers must agree with our f32.

    Of the first block the error is kept apart: later ones of ours also differ because the user's place, seen from the agent, follows from the motion made
    before, while peers are given the reference's."""
    latent = read(f"{args.dir}/prepared.safetensors")[0]["latent"]
    reference = flat(f"{args.dir}/prepared.safetensors")
    results, bad = {}, []
    for name in chosen(args.only):
        path = f"{args.dir}/{name}.out.safetensors"
        try:
            worker = Worker(args.dir, name, 2, "f32" if name.endswith("f32") else "f16")
            worker.wait()
            worker.ask(check=path)
            worker.close()
        except (RuntimeError, FileNotFoundError) as e:
            print(f"{name:14} not run: {e}", flush=True)
            continue
        got, says = flat(path), {}
        for key, want in reference.items():
            error = got[key] - want
            says[key] = {"largest": float(np.abs(error).max()), "relative": float(np.sqrt((error**2).mean() / (want**2).mean()))}
        error, want = (a[:latent] for a in (got["latents"] - reference["latents"], reference["latents"]))
        results[name] = says | {"first_block": float(np.sqrt((error**2).mean() / (want**2).mean()))}
        ok = max(s["largest"] for s in says.values()) <= TOLERANCE if name.endswith("f32") else bool(np.isfinite(got["decoded"]).all())
        bad += [] if ok else [name]
        print(f"{name:14} latents: largest {says['latents']['largest']:.2e}, relative {says['latents']['relative']:.2e}, first block {results[name]['first_block']:.2e}; "
              f"frames: largest {says['decoded']['largest']:.2e}, relative {says['decoded']['relative']:.2e}{'' if ok else '  DISAGREES'}", flush=True)
    merge(f"{args.dir}/check.json", results)
    if bad:
        raise SystemExit(f"outputs disagree with our f32 by more than {TOLERANCE}: {', '.join(bad)}")


def merge(path, results):
    old = json.load(open(path)) if os.path.exists(path) else {}
    with open(path, "w") as f:
        json.dump(old | results, f, indent=1)


def time_all(args):
    """Rounds in which every worker computes some blocks, one worker at a time; the first block of a turn is not counted."""
    path = f"{args.dir}/times.json"
    runs = json.load(open(path)) if os.path.exists(path) else []
    for threads in map(int, args.threads.split(",")):
        names = chosen(args.only)
        workers, times, memory = [], {n: [] for n in names}, {}
        for name in names:
            try:
                worker = Worker(args.dir, name, threads)
                worker.wait()
                worker.ask(time=WARM_OURS if name in OURS else WARM)
                workers.append(worker)
            except (RuntimeError, FileNotFoundError) as e:
                print(f"{name}: not run: {e}", flush=True)
        started, turns = time.monotonic(), 0
        while turns < 2 or time.monotonic() - started < args.seconds:
            for worker in workers if turns % 2 == 0 else workers[::-1]:
                answer = worker.ask(time=4)
                times[worker.name] += answer["ms"][1:]
                memory[worker.name] = {k: answer[k] for k in ("peak", "resident")}
            turns += 1
        for worker in workers:
            worker.close()
        run = {"threads": threads, "turns": turns, "peers": {w.name: {"ms": times[w.name], **memory[w.name]} for w in workers}}
        runs.append(run)
        with open(path, "w") as f:
            json.dump(runs, f)
        for name, peer in sorted(run["peers"].items(), key=lambda p: statistics.median(p[1]["ms"])):
            print(f"{threads} threads  {name:14} {statistics.median(peer['ms']):8.2f} ms  best {min(peer['ms']):8.2f}  {peer['resident'] / 1e6:6.0f} MB resident", flush=True)
