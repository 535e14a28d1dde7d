"""Visavis and other inference engines on the same network, in one run.

    python -m peers prepare --dir DIR [--only NAMES]     weights, ONNX files, quantised files, inputs, our f32 reference
    python -m peers check   --dir DIR [--only NAMES]     outputs of everyone against our f32
    python -m peers time    --dir DIR [--only NAMES] [--threads 1,2] [--seconds S]   interleaved; appends to DIR/times.json
    python -m peers grow    --dir DIR [--threads 2]      our block time against sizes, branches and sessions
    python -m peers table   --dir DIR [--out TABLE.md]   text, Markdown and DIR/table.json of all that was measured
"""
import argparse
import json
import os
import subprocess

from . import driver, growth, table


def ours(*args):
    return [os.environ["VISAVIS_PEERS_BIN"] + "/ours", *args]


def config(size):
    return json.loads(subprocess.run(ours("config", size), check=True, capture_output=True).stdout)


def prepare(args):
    from visavis_train import bundle
    from . import export, prepared, weights
    folder = args.dir
    os.makedirs(folder, exist_ok=True)
    path = f"{folder}/f32.safetensors"
    if not os.path.exists(path):
        weights.write(path, dict(config("paper"), student=None))
    for scheme in ("f16", "i8", "i4"):
        if not os.path.exists(f"{folder}/{scheme}.safetensors"):
            subprocess.run(ours("quantize", path, f"{folder}/{scheme}.safetensors", scheme), check=True)
    ready = f"{folder}/prepared.safetensors"
    if not os.path.exists(ready):
        b = bundle.read(path)
        prepared.write_inputs(f"{folder}/inputs.safetensors", b.config["vae"]["latent"], len(b.idle()) // 4)
        subprocess.run(ours("trace", path, f"{folder}/inputs.safetensors", f"{folder}/reference.safetensors"), check=True)
        prepared.write(ready, b, f"{folder}/inputs.safetensors", f"{folder}/reference.safetensors")
    if not os.path.exists(f"{folder}/decoder.onnx"):
        from .plain import read
        export.onnx(bundle.read(path), read(ready)[0], folder)
    from .worker import backend
    for name in driver.chosen(args.only):
        if name in driver.PYTHON:
            print(f"preparing {name}", flush=True)
            backend(name).prepare(folder, name)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["prepare", "check", "time", "table", "grow"])
    parser.add_argument("--dir", required=True)
    parser.add_argument("--only", default="", help="names or beginnings of names, by comma")
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--seconds", type=float, default=40, help="of measuring, for each number of threads")
    parser.add_argument("--out")
    args = parser.parse_args()
    {"prepare": prepare, "check": driver.check, "time": driver.time_all, "table": table.write, "grow": growth.measure}[args.what](args)


if __name__ == "__main__":
    main()
