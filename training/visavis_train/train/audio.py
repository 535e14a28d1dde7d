"""Trains the audio encoder alone: its features predict, causally, spectrum and prosody of the frames they end in.

    python -m visavis_train.train.audio --speech DIR --out runs/audio.pt --steps 2000

The targets of frame t come from the window of 1600 samples that ends with it: log-mel bands (of it and the frame before),
log energy, onset strength, voicing and log f0 from the autocorrelation. The head that predicts them is thrown away.

`--distil FOLDER` adds features of a larger model, HuBERT's for instance, as targets: for DIR/a/b.wav a file FOLDER/a/b.npy of [N, D] floats at
`--distil-rate` rows a second (50 for HuBERT), row i about the time i / rate. Files without one train on the other targets alone.
"""
import argparse
import glob
import os

import numpy as np
import torch
from scipy.signal import resample_poly
from torch import nn

from .. import wav
from ..nets.audio import FRAME_SAMPLES, AudioEncoder
from . import common
from .common import mixed
from .loop import Loop
from .sizes import SIZES, convolutions
from .team import Team

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
    power = torch.fft.rfft(padded * torch.hann_window(WINDOW, device=wave.device), 2048).abs().square()
    mel = ((power @ FILTERS.to(wave.device) + 1e-4).log() + 3) / 3
    before = torch.nn.functional.pad(mel[:, :-1], (0, 0, 1, 0), value=float((np.log(1e-4) + 3) / 3))
    energy = ((padded.square().mean(-1) + 1e-7).log() + 9) / 3
    onset = (mel - before).clamp(min=0).mean(-1) * 2
    spectrum = torch.fft.rfft(padded, 4096).abs().square()
    corr = torch.fft.irfft(spectrum)[..., :RATE // 70]
    lags = torch.arange(RATE // 400, RATE // 70, device=wave.device)
    strength = corr[..., lags] / (corr[..., :1] + 1e-3) * (WINDOW / (WINDOW - lags))
    voicing, best = strength.max(-1)
    voicing = ((voicing - 0.3) * 2).clamp(0, 1) * (energy > -1).float()
    pitch = ((RATE / lags[best]) / 150).log() * voicing * 2
    return torch.cat([mel, before, torch.stack([energy, onset, voicing * 2, pitch], -1)], -1)


def load(files):
    """Mono float32 at 24 kHz."""
    out = []
    for path in files:
        wave, rate = wav.read(path)
        out.append(resample_poly(wave, RATE, rate).astype(np.float32))
    return out


class Batches:
    """Random cuts with random speed and pitch (resampling), gain, noise, band limit and silence."""

    def __init__(self, waves, frames, teacher=None, rate=50.0, device="cpu"):
        """`teacher`: for each wave its features [N, D] at `rate` a second, or None."""
        self.device, self.frames, self.rate = torch.device(device), frames, rate
        lengths = torch.tensor([len(w) for w in waves])
        self.lengths, self.starts, self.wave = lengths, lengths.cumsum(0) - lengths, torch.cat([torch.as_tensor(w) for w in waves]).to(self.device)
        teacher = [torch.zeros(1, 0) if t is None else torch.as_tensor(t) for t in teacher or [None] * len(waves)]
        self.width = max(t.shape[1] for t in teacher)
        self.known = torch.tensor([t.shape[1] > 0 for t in teacher], dtype=torch.float32)
        self.rows = torch.tensor([len(t) if t.shape[1] else 1 for t in teacher])
        self.first = self.rows.cumsum(0) - self.rows
        self.teacher = torch.cat([t if t.shape[1] else torch.zeros(1, self.width) for t in teacher]).to(self.device)

    def cut(self, size):
        """Cuts [size, 800 frames] at random speeds, their waves, places and speeds [size]; zeros beyond a wave's end."""
        n = self.frames * FRAME_SAMPLES
        speed = torch.exp(torch.rand(size, dtype=torch.float64) * 0.6 - 0.3)
        which = torch.multinomial(self.lengths.float(), size, replacement=True)
        room = (self.lengths[which] - (n * speed).long() - 2).clamp(min=1)
        at = (torch.rand(size, dtype=torch.float64) * room).long()
        place = at[:, None] + torch.arange(n) * speed[:, None]
        low = place.long()
        ends, base = self.lengths[which][:, None], self.starts[which][:, None]
        sample = lambda i: self.wave[(base + i.clamp(max=ends - 1)).to(self.device)] * (i < ends).to(self.device)
        share = (place - low).float().to(self.device)
        return sample(low) * (1 - share) + sample(low + 1) * share, which, at, speed

    @staticmethod
    def dull(wave, chance=0.3, widest=11):
        """Some of the waves through a Hann-shaped low pass of 3 to `widest` samples."""
        size = len(wave)
        width = torch.where(torch.rand(size) < chance, torch.randint(3, widest + 1, (size,)), torch.ones(size, dtype=torch.long))
        i = torch.arange(-(widest // 2), widest // 2 + 1)
        kernel = (0.5 + 0.5 * torch.cos(2 * np.pi * i / (width[:, None] + 1))) * (2 * i.abs() < width[:, None] + 1)
        kernel = (kernel / kernel.sum(1, keepdim=True)).to(wave.device)
        return nn.functional.conv1d(wave[None], kernel[:, None], padding=widest // 2, groups=size)[0]

    def batch(self, size):
        """Waves [size, 800 frames], teacher's features at the frames' ends [size, frames, D] and whether there are any [size]."""
        cut, which, at, speed = self.cut(size)
        n, uniform = cut.shape[1], lambda *shape: torch.rand(*shape)
        cut = self.dull(cut)
        level = torch.exp(np.log(0.03) + uniform(size, 1) * np.log(0.95 / 0.03)).to(self.device)
        cut = cut / (cut.abs().amax(1, keepdim=True) + 1e-3) * level
        noise = torch.exp(np.log(1e-4) + uniform(size, 1) * np.log(100.0)) * (uniform(size, 1) < 0.5)
        cut = cut + noise.to(self.device) * torch.randn_like(cut)
        ends = (at[:, None] + torch.arange(1, self.frames + 1) * FRAME_SAMPLES * speed[:, None]) / RATE * self.rate
        row = torch.minimum(ends.round().long(), self.rows[which][:, None] - 1)
        wish = self.teacher[(self.first[which][:, None] + row).to(self.device)]
        gap = (uniform(size, 2) * n).long().sort(1).values * (uniform(size, 1) < 0.3)
        gap = torch.where(uniform(size, 1) < 0.03, torch.tensor([0, n]), gap)
        i = torch.arange(n)
        cut = cut * ~((i >= gap[:, :1]) & (i < gap[:, 1:])).to(self.device)
        return cut, wish, (self.known[which] * (gap[:, 0] == gap[:, 1])).to(self.device)


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
    parser.add_argument("--size", choices=SIZES, default="base")
    parser.add_argument("--channels", type=int, nargs="+", help="channels after each convolution instead of the size's, at least five")
    parser.add_argument("--features", type=int, help="width of the features instead of the size's")
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--distil", metavar="FOLDER", help="features of a larger model as further targets (see above)")
    parser.add_argument("--distil-rate", type=float, default=50.0)
    parser.add_argument("--distil-weight", type=float, default=0.5)
    parser.add_argument("--init", help="checkpoint to start from")
    common.arguments(parser, steps=2000, lr=2e-3, batch=24)
    args = parser.parse_args()
    device, team = common.start_process(args), Team(args.workers)
    size = dict(SIZES[args.size]["audio"])
    if args.channels:
        size["layers"] = convolutions(*args.channels)
    if args.features:
        size["features"] = args.features
    every = sorted(glob.glob(os.path.join(args.speech, "**", "*.wav"), recursive=True))

    def pick(starts):
        starts = [s for s in starts.split(",") if s]
        return [f for f in every if not starts or any(os.path.relpath(f, args.speech).startswith(s) for s in starts)]

    chosen = pick(args.only)
    if not chosen:
        raise SystemExit(f"no wav files under {args.speech}")
    teacher = load_teacher(args.distil, args.speech, chosen) if args.distil else None
    train = Batches(load(chosen), args.frames, teacher, args.distil_rate, device)
    held = Batches(load(pick(args.validate or args.only)), args.frames, device=device)
    torch.manual_seed(1)
    check = held.batch(64)[0]
    check_targets = targets(check)
    first = common.load(args.out if args.resume else args.init) if args.resume or args.init else None
    net = (AudioEncoder(first["spec"], first["features"]) if first else AudioEncoder(**size)).to(device)
    if first:
        net.load_state_dict(first["net"])
    width = net.out.out_features
    heads = nn.ModuleList([nn.Linear(width, 2 * BANDS + 4)] + ([nn.Linear(width, train.width)] if train.width else [])).to(device)
    loop = Loop(team, net, args, warmup=100, average=0.995, beside={"heads": heads}, spec=net.spec, features=width)

    @torch.no_grad()
    def measure(net):
        error = (loop.averages["heads"].net[0](net(check)) - check_targets).square()
        return {"val": error.mean().item()} | {k: error[..., i].mean().item() for k, i in (("energy", -4), ("onset", -3), ("voicing", -2), ("pitch", -1))}

    for _ in loop:
        wave, wish, known = train.batch(args.batch)
        with mixed(device):
            heard = net(wave).float()
        loss = plain = (heads[0](heard) - targets(wave)).square().mean()
        if train.width:
            error = (heads[1](heard) - wish).square().mean((1, 2))
            loss = loss + args.distil_weight * (error * known).sum() / (known.sum() + 1)
        loop.update(loss, train=plain)
        loop.report(50, measure)
    standardise(loop.ema.net, torch.cat([train.batch(64)[0], check]))
    loop.finish()


if __name__ == "__main__":
    main()
