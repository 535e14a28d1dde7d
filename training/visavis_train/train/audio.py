"""Trains the audio encoder alone: its features predict, causally, spectrum and prosody of the frames they end in.

    python -m visavis_train.train.audio --speech DIR --out runs/audio.pt --minutes 10

The targets of frame t come from the window of 1600 samples that ends with it: log-mel bands (of it and the frame before),
log energy, onset strength, voicing and log f0 from the autocorrelation. The head that predicts them is thrown away.
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

    def __init__(self, waves, frames, seed=0):
        self.waves, self.frames, self.random = waves, frames, np.random.default_rng(seed)
        self.weights = np.array([len(w) for w in waves], dtype=float)
        self.weights /= self.weights.sum()

    def one(self):
        r, n = self.random, self.frames * FRAME_SAMPLES
        if r.random() < 0.03:
            return np.zeros(n, dtype=np.float32)
        speed = float(np.exp(r.uniform(-0.3, 0.3)))
        wave = self.waves[r.choice(len(self.waves), p=self.weights)]
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
        if r.random() < 0.3:
            a, b = sorted(r.integers(0, n, 2))
            cut[a:b] = 0
        return cut.astype(np.float32)

    def batch(self, size):
        return torch.tensor(np.stack([self.one() for _ in range(size)]))


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
    parser.add_argument("--init", help="checkpoint to start from")
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    torch.manual_seed(0)
    every = sorted(glob.glob(os.path.join(args.speech, "**", "*.wav"), recursive=True))

    def pick(starts):
        starts = [s for s in starts.split(",") if s]
        return [f for f in every if not starts or any(os.path.relpath(f, args.speech).startswith(s) for s in starts)]

    train, held = Batches(load(pick(args.only)), args.frames), Batches(load(pick(args.validate or args.only)), args.frames, 1)
    check = held.batch(64)
    check_targets = targets(check)
    net, head = AudioEncoder(features=args.features), nn.Linear(args.features, 2 * BANDS + 4)
    if args.init:
        net.load_state_dict(torch.load(args.init, weights_only=False)["net"])
    both = nn.ModuleList([net, head])
    optim, log, clock = common.optimiser(both, args.lr), common.Log(args.out + ".jsonl"), common.Clock(args.minutes)
    step = 0
    while clock.progress < 1:
        wave = train.batch(args.batch)
        with torch.autocast("cpu", torch.bfloat16):
            features = net(wave)
        loss = (head(features.float()) - targets(wave)).square().mean()
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
    standardise(net, torch.cat([train.batch(64), check]))
    common.save(args.out, net=net.state_dict(), spec=net.spec, features=args.features)


if __name__ == "__main__":
    main()
