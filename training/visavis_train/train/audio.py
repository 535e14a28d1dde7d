"""Trains the audio encoder alone: its features predict, causally, spectrum and prosody of the frames they end in.

    python -m visavis_train.train.audio --speech DIR --out runs/audio.pt --minutes 10

The targets of frame t come from the window of 1600 samples that ends with it: log-mel bands (of it and the frame before),
log energy, onset strength, voicing and log f0 from the autocorrelation. The head that predicts them is thrown away.

`--distil FOLDER` adds features of a larger model, HuBERT's for instance, as targets: for DIR/a/b.wav a file FOLDER/a/b.npy of [N, D] floats at
`--distil-rate` rows a second (50 for HuBERT), row i about the time i / rate. Files without one train on the other targets alone.
"""
import argparse
import glob
import os

import numpy as np
import soundfile
import torch
from scipy.signal import resample_poly
from torch import nn

from ..nets.audio import FRAME_SAMPLES, AudioEncoder
from . import common

RATE = 24000
WINDOW = 1600
BANDS = 40


def mel_filters(bands=BANDS, size=2048, low=60.0, high=8000.0):
    """Triangular filters [size / 2 + 1, bands], HTK mel scale."""
    mel = lambda f: 2595 * np.log10(1 + f / 700)
    edges = 700 * (10 ** (np.linspace(mel(low), mel(high), bands + 2) / 2595) - 1)
    f = np.arange(size // 2 + 1) * RATE / size
    up = (f[:, None] - edges[:-2]) / (edges[1:-1] - edges[:-2])
    down = (edges[2:] - f[:, None]) / (edges[2:] - edges[1:-1])
    return torch.tensor(np.clip(np.minimum(up, down), 0, None), dtype=torch.float32)


FILTERS = mel_filters()


@torch.no_grad()
def targets(wave):
    """wave [B, 800 T] -> [B, T, 2 * 40 + 4], each about unit variance on speech."""
    padded = torch.nn.functional.pad(wave, (WINDOW - FRAME_SAMPLES, 0)).unfold(1, WINDOW, FRAME_SAMPLES)
    power = torch.fft.rfft(padded * torch.hann_window(WINDOW), 2048).abs().square()
    mel = ((power @ FILTERS + 1e-4).log() + 3) / 3
    before = torch.nn.functional.pad(mel[:, :-1], (0, 0, 1, 0), value=float((np.log(1e-4) + 3) / 3))
    energy = ((padded.square().mean(-1) + 1e-7).log() + 9) / 3
    onset = (mel - before).clamp(min=0).mean(-1) * 2
    spectrum = torch.fft.rfft(padded, 4096).abs().square()
    corr = torch.fft.irfft(spectrum)[..., :RATE // 70]
    lags = torch.arange(RATE // 400, RATE // 70)
    strength = corr[..., lags] / (corr[..., :1] + 1e-3) * (WINDOW / (WINDOW - lags))
    voicing, best = strength.max(-1)
    voicing = ((voicing - 0.3) * 2).clamp(0, 1) * (energy > -1).float()
    pitch = ((RATE / lags[best]) / 150).log() * voicing * 2
    return torch.cat([mel, before, torch.stack([energy, onset, voicing * 2, pitch], -1)], -1)


def load(files):
    """Mono float32 at 24 kHz."""
    out = []
    for path in files:
        wave, rate = soundfile.read(path, dtype="float32", always_2d=True)
        out.append(resample_poly(wave.mean(1), RATE, rate).astype(np.float32))
    return out


class Batches:
    """Random cuts with random speed and pitch (resampling), gain, noise, band limit and silence."""

    def __init__(self, waves, frames, seed=0, teacher=None, rate=50.0):
        """`teacher`: for each wave its features [N, D] at `rate` a second, or None."""
        self.waves, self.frames, self.random = waves, frames, np.random.default_rng(seed)
        self.teacher, self.rate = teacher or [None] * len(waves), rate
        self.width = next((t.shape[1] for t in self.teacher if t is not None), 0)
        self.weights = np.array([len(w) for w in waves], dtype=float)
        self.weights /= self.weights.sum()

    def one(self):
        """A cut [800 frames], its teacher's features at the frames' ends [frames, D] and whether there are any."""
        r, n = self.random, self.frames * FRAME_SAMPLES
        if r.random() < 0.03:
            return np.zeros(n, dtype=np.float32), np.zeros((self.frames, self.width), np.float32), 0.0
        speed = float(np.exp(r.uniform(-0.3, 0.3)))
        which = r.choice(len(self.waves), p=self.weights)
        wave = self.waves[which]
        need = int(n * speed) + 2
        at = r.integers(0, max(1, len(wave) - need))
        cut = wave[at:at + need]
        cut = np.pad(cut, (0, need - len(cut)))
        cut = np.interp(np.arange(n) * speed, np.arange(need), cut)
        if r.random() < 0.3:
            k = int(r.integers(3, 12))
            cut = np.convolve(cut, np.hanning(k + 2)[1:-1] / np.hanning(k + 2).sum(), "same")
        cut = cut / (np.abs(cut).max() + 1e-3) * np.exp(r.uniform(np.log(0.03), np.log(0.95)))
        if r.random() < 0.5:
            cut = cut + np.exp(r.uniform(np.log(1e-4), np.log(1e-2))) * r.standard_normal(n)
        wish, known = np.zeros((self.frames, self.width), np.float32), 0.0
        if self.teacher[which] is not None:
            ends = (at + np.arange(1, self.frames + 1) * FRAME_SAMPLES * speed) / RATE * self.rate
            wish, known = self.teacher[which][np.clip(np.round(ends).astype(int), 0, len(self.teacher[which]) - 1)], 1.0
        if r.random() < 0.3:
            a, b = sorted(r.integers(0, n, 2))
            cut[a:b] = 0
            known *= a == b
        return cut.astype(np.float32), wish, known

    def batch(self, size):
        """Waves [size, 800 frames], teacher's features [size, frames, D] and flags [size]."""
        return tuple(torch.tensor(np.stack(c), dtype=torch.float32) for c in zip(*[self.one() for _ in range(size)]))


def load_teacher(folder, root, files):
    """Features of each file, standardised over all, or None where there are none."""
    rows = []
    for f in files:
        path = os.path.join(folder, os.path.splitext(os.path.relpath(f, root))[0] + ".npy")
        rows.append(np.load(path).astype(np.float32) if os.path.exists(path) else None)
    known = [r for r in rows if r is not None]
    if not known:
        raise SystemExit(f"--distil {folder}: no .npy there belongs to a wav under {root}; FOLDER/a/b.npy goes with a/b.wav")
    if len({r.shape[1] for r in known}) != 1:
        raise SystemExit(f"--distil {folder}: features differ in width: {sorted({r.shape[1] for r in known})}")
    every = np.concatenate(known)
    mean, std = every.mean(0), every.std(0) + 1e-3
    return [None if r is None else (r - mean) / std for r in rows]


def standardise(net, wave):
    """Folds the features' mean and deviation into the last linear map."""
    with torch.no_grad():
        y = net(wave).flatten(0, 1)
        mean, std = y.mean(0), y.std(0).clamp(min=1e-3)
        net.out.weight.div_(std[:, None])
        net.out.bias.sub_(mean).div_(std)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--speech", required=True, help="folder with wav files, searched recursively")
    parser.add_argument("--only", default="", help="comma-separated starts of relative paths to take (a split); default all")
    parser.add_argument("--validate", default="", help="the same for validation")
    parser.add_argument("--out", required=True)
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--batch", type=int, default=24)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--features", type=int, default=64)
    parser.add_argument("--lr", type=float, default=2e-3)
    parser.add_argument("--distil", metavar="FOLDER", help="features of a larger model as further targets (see above)")
    parser.add_argument("--distil-rate", type=float, default=50.0)
    parser.add_argument("--distil-weight", type=float, default=0.5)
    parser.add_argument("--init", help="checkpoint to start from")
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    torch.manual_seed(0)
    every = sorted(glob.glob(os.path.join(args.speech, "**", "*.wav"), recursive=True))

    def pick(starts):
        starts = [s for s in starts.split(",") if s]
        return [f for f in every if not starts or any(os.path.relpath(f, args.speech).startswith(s) for s in starts)]

    chosen = pick(args.only)
    teacher = load_teacher(args.distil, args.speech, chosen) if args.distil else None
    train, held = Batches(load(chosen), args.frames, 0, teacher, args.distil_rate), Batches(load(pick(args.validate or args.only)), args.frames, 1)
    check = held.batch(64)[0]
    check_targets = targets(check)
    net, head = AudioEncoder(features=args.features), nn.Linear(args.features, 2 * BANDS + 4)
    if args.init:
        net.load_state_dict(torch.load(args.init, weights_only=False)["net"])
    both = nn.ModuleList([net, head] + ([nn.Linear(args.features, train.width)] if train.width else []))
    optim, log, clock = common.optimiser(both, args.lr), common.Log(args.out + ".jsonl"), common.Clock(args.minutes)
    step = 0
    while clock.progress < 1:
        wave, wish, known = train.batch(args.batch)
        with torch.autocast("cpu", torch.bfloat16):
            features = net(wave)
        loss = (head(features.float()) - targets(wave)).square().mean()
        if train.width:
            error = (both[2](features.float()) - wish).square().mean((1, 2))
            loss = loss + args.distil_weight * (error * known).sum() / (known.sum() + 1)
        common.set_rate(optim, common.rate(args.lr, step, clock.progress, 100))
        optim.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(both.parameters(), 1.0)
        optim.step()
        step += 1
        if step % 50 == 0:
            with torch.no_grad():
                error = (head(net(check)) - check_targets).square()
            log.write(step=step, minutes=clock.elapsed / 60, train=loss.item(), val=error.mean().item(), energy=error[..., -4].mean().item(),
                      onset=error[..., -3].mean().item(), voicing=error[..., -2].mean().item(), pitch=error[..., -1].mean().item())
            common.save(args.out, net=net.state_dict(), spec=net.spec, features=args.features)
    net.eval()
    standardise(net, torch.cat([train.batch(64)[0], check]))
    common.save(args.out, net=net.state_dict(), spec=net.spec, features=args.features)


if __name__ == "__main__":
    main()
