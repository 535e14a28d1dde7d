"""What travels to a machine with a GPU: the recordings from which the corpus is built there, and checkpoints to go on from.

    python training/gpu/pack.py --data ../shared/data                 # carry/data: motion and voices
    python training/gpu/pack.py --runs WORK/runs [--only vae,audio]   # carry/start: averaged weights, f16

A corpus of 20 hours does not travel: its poses alone would be 40 MB at 20 bytes a frame, its voices' features 280 MB at a byte a number. What it is
built from is less than an hour of motion and an hour of speech, and 16 cores build it in a few minutes. Texts are written with 1e-3 degrees and units
(1e-5 radians), samples with 16 bits, floats with 16 bits of mantissa: below the recordings' own noise.
"""
import argparse
import io
import lzma
import os
import re
import shutil
import sys
import tarfile

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
from visavis_train import wav  # noqa: E402

CARRY = os.path.join(HERE, "carry")
UNUSED = ("cmu_stand",)
NUMBER = re.compile(rb"-?\d*\.\d{4,}(?:[eE][-+]?\d+)?")
TEXTS = {".bvh": b"%.3f", ".txt": b"%.5f"}


def shortened(text, form):
    return NUMBER.sub(lambda m: (form % float(m.group())).rstrip(b"0").rstrip(b".") or b"0", text)


def truncated(path):
    """A .npz with the lowest 7 bits of its floats cleared, uncompressed."""
    with np.load(path) as f:
        arrays = {k: f[k] for k in f}
    for k, v in arrays.items():
        if v.dtype == np.float32:
            arrays[k] = (np.ascontiguousarray(v).view(np.int32) & ~np.int32(0x7F)).view(np.float32).reshape(v.shape)
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


def pcm(path):
    """A wav file of 16 bit samples."""
    from scipy.io import wavfile
    samples, rate = wav.read(path)
    out = io.BytesIO()
    wavfile.write(out, rate, np.clip(np.round(samples * 32768), -32768, 32767).astype(np.int16))
    return out.getvalue()


def content(path):
    kind = os.path.splitext(path)[1]
    if kind in TEXTS and "README" not in path:
        with open(path, "rb") as f:
            return shortened(f.read(), TEXTS[kind])
    if kind == ".npz":
        return truncated(path)
    if kind == ".wav":
        return pcm(path)
    with open(path, "rb") as f:
        return f.read()


def files(folder):
    for at, folders, names in os.walk(folder):
        folders[:] = sorted(d for d in folders if d not in UNUSED)
        for name in sorted(names):
            if os.path.splitext(name)[1] not in (".png", ".md", ".tsv"):
                yield os.path.join(at, name)


def archive(data, part, out):
    """DATA/PART as a .tar.xz; samples of sound are stored as differences."""
    first = [{"id": lzma.FILTER_DELTA, "dist": 2}] if part == "speech" else []
    with lzma.open(out, "wb", filters=[*first, {"id": lzma.FILTER_LZMA2, "preset": 6}]) as packed, tarfile.open(fileobj=packed, mode="w|") as tar:
        for path in files(os.path.join(data, part)):
            held = content(path)
            entry = tarfile.TarInfo(os.path.relpath(path, data))
            entry.size = len(held)
            tar.addfile(entry, io.BytesIO(held))


def checkpoints(runs, only, out):
    """Averaged weights of the trainings in RUNS."""
    from visavis_train.train import common
    from visavis_train.train.all import CHECKPOINTS
    for stage, name in CHECKPOINTS.items():
        path = os.path.join(runs, name)
        if os.path.exists(path) and (not only or stage in only):
            common.save(os.path.join(out, name), **common.light(common.load(path)))
            if os.path.exists(os.path.join(runs, f"{stage}.done")):
                open(os.path.join(out, f"{stage}.done"), "w").close()


def size(folder):
    return sum(os.path.getsize(os.path.join(at, name)) for at, _, names in os.walk(folder) for name in names)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", help="folder with motion/ and speech/")
    parser.add_argument("--runs", help="checkpoints of an earlier training to go on from")
    parser.add_argument("--only", default="", help="comma-separated stages whose checkpoints to take, of those in --runs")
    parser.add_argument("--carry", default=CARRY)
    args = parser.parse_args()
    if not args.data and not args.runs:
        raise SystemExit("--data or --runs is needed")
    for name, make in (("data", args.data and (lambda out: [archive(args.data, part, os.path.join(out, part + ".tar.xz")) for part in ("motion", "speech")])),
                       ("start", args.runs and (lambda out: checkpoints(args.runs, [s for s in args.only.split(",") if s], out)))):
        if make:
            out = os.path.join(args.carry, name)
            shutil.rmtree(out, ignore_errors=True)
            os.makedirs(out)
            make(out)
            print(f"{out}: {size(out) / 2**20:.1f} MiB")


if __name__ == "__main__":
    main()
