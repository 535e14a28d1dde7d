"""What an ear hears, 132 numbers a frame at 30 frames a second: the definitions of librosa 0.11 without librosa (mirrored in src/audio).

    0..20 MFCC | 20..40 their deltas | 40..52 constant-Q chroma | 52..64 STFT chroma | 64 onset strength | 65..129 tempogram | 129 beats |
    130 RMS energy | 131 active (RMS > 0.01)

Frame t of N samples at 24 kHz is centred on sample 800 t, T = N // 800. The constant-Q transform is librosa's `pseudo_cqt`: one rate, one FFT, magnitudes of
its kernels on magnitudes of a spectrum. The paper's tempogram has 1068 lags, 36 s at this rate; here it has 64, 2.1 s. All in f64, as near silence
normalised features take any noise for signal. `against_librosa` in `training/tests/test_mospa.py` has the calls.
"""
import functools

import numpy as np

RATE, HOP = 24000, 800
N_FFT, CQ_FFT = 2048, 8192
MELS, MFCC, CHROMA, TEMPO = 128, 20, 12, 64
CQ_LOW, CQ_BINS = 440.0 * 2 ** (-33 / 12), 72     # C2, six octaves
ACTIVE = 0.01
SIZE = 2 * MFCC + 2 * CHROMA + 1 + TEMPO + 3


def hann(n):
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)


def frames_of(y, n):
    """Stretches [T, n] of y, centred on every 800th sample, zeros beyond its ends."""
    padded = np.pad(np.asarray(y, np.float64), n // 2)
    return np.lib.stride_tricks.sliding_window_view(padded, n)[::HOP][:len(y) // HOP]


def spectrum(y, n):
    """Magnitudes [T, n / 2 + 1] of the Hann-windowed frames."""
    return np.abs(np.fft.rfft(frames_of(y, n) * hann(n), axis=-1))


@functools.cache
def mel_filters():
    """Slaney's triangles [128, 1025] from 0 to 12 kHz, each of unit area."""
    knee, step = 1000.0, np.log(6.4) / 27.0
    to_mel = lambda f: f * 3 / 200 if f < knee else 15.0 + np.log(f / knee) / step
    mels = np.linspace(0.0, to_mel(RATE / 2), MELS + 2)
    edges = np.where(mels < 15.0, mels * 200 / 3, knee * np.exp(step * (mels - 15.0)))
    ramps = edges[:, None] - np.fft.rfftfreq(N_FFT, 1 / RATE)
    gap = np.diff(edges)[:, None]
    weights = np.maximum(0, np.minimum(-ramps[:-2] / gap[:-1], ramps[2:] / gap[1:]))
    return weights * (2.0 / (edges[2:] - edges[:-2]))[:, None]


@functools.cache
def chroma_filters():
    """[12, 1025]: Gaussians about each pitch class, of unit length in every bin, weighed about the fifth octave of A; first row C."""
    bins = 12 * np.log2(np.arange(1, N_FFT) * (RATE / N_FFT) / (440.0 / 16))
    bins = np.concatenate([[bins[0] - 18], bins])
    width = np.concatenate([np.maximum(np.diff(bins), 1.0), [1.0]])
    off = np.remainder(bins - np.arange(12)[:, None] + 6 + 120, 12) - 6
    w = np.exp(-0.5 * (2 * off / width) ** 2)
    w = w / np.sqrt((w ** 2).sum(0)) * np.exp(-0.5 * ((bins / 12 - 5.0) / 2.0) ** 2)
    return np.roll(w, -3, axis=0)[:, :1 + N_FFT // 2]


@functools.cache
def constant_q_filters():
    """[12, 4097]: magnitudes of 72 windowed complex tones' spectra, those of a pitch class added up; first row C."""
    ratio = 2.0 ** (2 / 12)
    q = (ratio + 1) / (ratio - 1)
    out = np.zeros((12, 1 + CQ_FFT // 2))
    for k in range(CQ_BINS):
        f = CQ_LOW * 2 ** (k / 12)
        length = q * RATE / f
        at = np.arange(-length // 2, length // 2)
        tone = hann(len(at)) * np.exp(2j * np.pi * at * f / RATE)
        tone *= length / CQ_FFT / np.abs(tone).sum()
        out[k % 12] += np.abs(np.fft.fft(tone, CQ_FFT)[:1 + CQ_FFT // 2])
    return out / np.sqrt(CQ_FFT)


def unit_peak(x):
    """Rows divided by their largest magnitude, those of zeros as they are."""
    peak = np.abs(x).max(-1, keepdims=True)
    return x / np.where(peak < np.finfo(np.float64).tiny, 1.0, peak)


def decibels(power):
    """10 log10 of at least 1e-10, at most 80 dB below the loudest of the clip."""
    db = 10 * np.log10(np.maximum(power, 1e-10))
    return np.maximum(db, db.max() - 80.0)


def cosines(db):
    """The first 20 coefficients [T, 20] of the orthonormal DCT-II over the bands."""
    n = db.shape[-1]
    basis = np.cos(np.pi * np.outer(np.arange(MFCC), np.arange(n) + 0.5) / n) * np.sqrt(2 / n)
    basis[0] /= np.sqrt(2)
    return db @ basis.T


def slopes(x):
    """Slope [T, C] of the line through nine frames, four on each side; the first four and last four frames share that of the first and last nine."""
    if len(x) < 9:
        raise ValueError(f"{len(x)} frames: deltas need at least 9, 0.3 s of sound")
    k = np.arange(-4, 5) / 60.0
    inner = np.einsum("tck,k->tc", np.lib.stride_tricks.sliding_window_view(x, 9, axis=0), k)
    return np.pad(inner, ((4, 4), (0, 0)), mode="edge")


def onsets(db):
    """Mean rise of the bands [T] since the frame before, two frames late, as librosa centres it."""
    rise = np.maximum(np.diff(db, axis=0), 0).mean(-1)
    return np.concatenate([np.zeros(2), rise])[:len(db)]


def tempogram(envelope, lags):
    """Autocorrelation [T, lags] of the Hann-windowed envelope around each frame, peak 1; beyond its ends the envelope falls to zero in straight lines."""
    half = lags // 2
    padded = np.pad(envelope, half, mode="linear_ramp", end_values=0.0)
    rows = np.lib.stride_tricks.sliding_window_view(padded, lags)[:len(envelope)] * hann(lags)
    power = np.abs(np.fft.rfft(rows, 2 * lags, axis=-1)) ** 2
    return unit_peak(np.fft.irfft(power, 2 * lags, axis=-1)[:, :lags])


def period(envelope):
    """Frames of a beat: the lag of 6 to 239 at which the mean tempogram of 8 s is strongest, with a log-normal preference for 120 a minute."""
    lags = 8 * RATE // HOP
    strength = np.log1p(1e6 * tempogram(envelope, lags).mean(0)[6:])
    return 6 + int((strength - 0.5 * np.log2(60 * RATE / HOP / np.arange(6, lags) / 120.0) ** 2).argmax())


def beats(envelope, tightness=100.0):
    """Beats [T] 0 or 1 by dynamic programming (Ellis 2007), those of weak onsets at both ends left out."""
    n, out = len(envelope), np.zeros(len(envelope))
    if not envelope.any():
        return out
    every = period(envelope)
    window = np.exp(-0.5 * (np.arange(-every, every + 1) * 32.0 / every) ** 2)
    strength = envelope / (envelope.std(ddof=1) + np.finfo(np.float64).tiny)
    # librosa's same-mode sum leaves out the product with the first frame's value at full reach
    score = np.array([sum(window[k] * strength[i + every - k] for k in range(max(0, i + every - n + 1), min(i + every, 2 * every + 1))) for i in range(n)])
    total, before, first = np.zeros(n), np.full(n, -1), True
    for i in range(n):
        places = np.arange(i - int(np.round(every / 2)), max(-1, i - 2 * every - 1), -1)
        best = -np.inf
        if len(places) and places[0] >= 0:
            scores = total[places] - tightness * (np.log(i - places) - np.log(every)) ** 2
            k = int(scores.argmax())
            best = scores[k]
        total[i] = score[i] + (best if best > -np.inf else 0.0)
        if not (first and score[i] < 0.01 * score.max()):
            before[i], first = (places[k] if best > -np.inf else -1), False
    inner = np.concatenate([[False], (total[1:] > total[:-1]) & np.concatenate([total[1:-1] >= total[2:], [True]])])
    good = np.flatnonzero(inner & (total >= (0.5 * np.median(total[inner]) if inner.any() else 0.0)))
    at = int(good[-1]) if len(good) else n - 1
    while at >= 0:
        out[at] = 1.0
        at = before[at]
    smooth = np.convolve(score[out > 0], np.hanning(5))[2:n + 2]
    strong = np.flatnonzero(score > 0.5 * np.sqrt((smooth ** 2).mean()))
    if len(strong):
        out[:strong[0]], out[strong[-1] + 1:] = 0.0, 0.0
    return out


def ear(y):
    """Features [T, 132] f64 of one ear's samples [N]."""
    power = spectrum(y, N_FFT) ** 2
    db = decibels(power @ mel_filters().T)
    envelope, mfcc = onsets(db), cosines(db)
    rms = np.sqrt((frames_of(y, N_FFT) ** 2).mean(-1))
    return np.concatenate([mfcc, slopes(mfcc), unit_peak(spectrum(y, CQ_FFT) @ constant_q_filters().T), unit_peak(power @ chroma_filters().T),
                           envelope[:, None], tempogram(envelope, TEMPO), beats(envelope)[:, None], rms[:, None], (rms > ACTIVE)[:, None]], -1)
