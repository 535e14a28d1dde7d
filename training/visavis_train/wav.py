"""WAV files as float32."""
import warnings

import numpy as np
from scipy.io import wavfile

FULL = {np.dtype(np.int16): 32768.0, np.dtype(np.int32): 2147483648.0, np.dtype(np.float32): 1.0, np.dtype(np.float64): 1.0}


def read(path):
    """Mono samples [N] float32 in -1 .. 1 (channels averaged) and their rate."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", wavfile.WavFileWarning)  # chunks of metadata that are not understood
        rate, samples = wavfile.read(path)
    if samples.dtype not in FULL:
        raise ValueError(f"{path}: samples are {samples.dtype}; 16 or 32 bit integers and floats are read")
    samples = samples.astype(np.float32) / np.float32(FULL[samples.dtype])
    return samples if samples.ndim == 1 else samples.mean(1), rate
