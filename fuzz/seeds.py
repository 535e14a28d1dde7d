#!/usr/bin/env python3
"""Writes small seed corpora for the fuzz targets into fuzz/corpus/: python3 fuzz/seeds.py"""

import pathlib
import struct

here = pathlib.Path(__file__).resolve().parent
corpus = here / "corpus"
goldens = here.parent / "tests/goldens"
tiny = (goldens / "tiny.safetensors").read_bytes()


def seed(target, name, data):
    folder = corpus / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(data)


def wav(rate, bits, channels, samples, kind=1):
    block = bits // 8 * channels
    form = struct.pack("<HHIIHH", kind, channels, rate, rate * block, block, bits)
    return (b"RIFF" + struct.pack("<I", 36 + len(samples)) + b"WAVEfmt " + struct.pack("<I", 16) + form
            + b"data" + struct.pack("<I", len(samples)) + samples)


def extensible(rate, bits, valid, samples):
    block = bits // 8
    guid = b"\x01\0\0\0\0\0\x10\0\x80\0\0\xaa\0\x38\x9b\x71"
    form = struct.pack("<HHIIHHHHI", 0xFFFE, 1, rate, rate * block, block, bits, 22, valid, 4) + guid
    return (b"RIFF" + struct.pack("<I", 60 + len(samples)) + b"WAVEfmt " + struct.pack("<I", len(form)) + form
            + b"data" + struct.pack("<I", len(samples)) + samples)


ramp = bytes(range(240))
for rate, bits, channels in [(8000, 8, 1), (16000, 16, 1), (44100, 24, 2), (48000, 32, 1), (192000, 16, 8)]:
    seed("wav", f"pcm-{rate}-{bits}-{channels}", wav(rate, bits, channels, ramp))
seed("wav", "float", wav(24000, 32, 1, struct.pack("<8f", *[0.1 * i for i in range(8)]), kind=3))
seed("wav", "extensible", extensible(48000, 32, 24, ramp))
seed("wav", "extensible-lie", extensible(48000, 16, 40, ramp))
seed("wav", "huge-chunk", wav(16000, 16, 1, ramp)[:40] + b"\xff\xff\xff\xff" + ramp)
seed("wav", "odd-chunk", wav(16000, 16, 1, ramp)[:36] + b"LIST\x05\0\0\0abcde\0" + b"data\x04\0\0\0\1\2\3\4")

seed("csv", "plain", b"t,x,y,z\n0,0,1.6,2\n0.5,0.1,1.6,2\n1,0.2,1.6,2\n")
seed("csv", "spreadsheet", "\ufefft,x,y,z\r\n0,1,1.6,-2\r\n\r\n5e-1,2,1.5,0\r\n".encode())
seed("csv", "wrong", b"t,x,y,z\n0,nan,1e400,2\n-1,,0,inf\n")

header = 8 + struct.unpack("<Q", tiny[:8])[0]
# A whole one, the small bundle, the target writes itself; those of the featherweight tier are small enough.
seed("bundle_bytes", "header", tiny[:header])
for backbone in ["tcn", "lstm"]:
    seed("bundle_bytes", f"dram-{backbone}", (goldens / f"dram-{backbone}.safetensors").read_bytes())
seed("bundle_bytes", "length", b"\xff" * 8 + b"{}")
seed("bundle_bytes", "empty-container", struct.pack("<Q", 2) + b"{}")

for target in ["bundle_lies", "session", "capi"]:
    for i in range(8):
        seed(target, f"bytes-{i}", bytes((j * (7 + 2 * i) + i) % 256 for j in range(64 * (i + 1))))
# The first byte chooses the bundle (fuzz_targets): both backbones, kept and with options of their own, and a session that falls back.
steps = bytes((j * 11 + 3) % 256 for j in range(192))
for name, first in [("tcn", 2), ("lstm", 3)]:
    seed("bundle_lies", f"dram-{name}", bytes([first]) + steps[:63])
for name, first in [("tcn", 50), ("lstm", 80), ("tcn-own", 34), ("lstm-own", 35), ("fallback", 100)]:
    seed("session", f"dram-{name}", bytes([first]) + steps)
# Late blocks one after the other: Due is step 5, Late step 11, of 18; arbitrary scales a 32-bit number.
step = lambda i: struct.pack("<I", (i * 2**32 + 2**31) // 18)
seed("session", "falls-back", bytes([100]) + b"".join(step(5) + step(11) + b"\1" for _ in range(8)) + bytes(8))
print(f"seeds in {corpus}")
