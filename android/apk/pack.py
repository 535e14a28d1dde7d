#!/usr/bin/env python3
"""usage: pack.py BASE.apk OUT.apk [NAME=FILE ...]
An unsigned APK of aapt2's output (manifest, resources) and further entries (classes.dex, lib/..., assets/...); the same input gives the same bytes.

Stored, because Android reads them where they lie: resources.arsc (at 4 bytes; demanded since Android 11), libraries (at 16 KiB, the largest page),
bundles and sounds (at 4 KiB). The rest is deflated. Offsets are padded by extra fields of kind 0xd935, which apksigner keeps."""
import struct
import sys
import zipfile
import zlib

STORED = {".so": 16384, ".arsc": 4, ".safetensors": 4096, ".wav": 4096}
TIME, DATE = 0, 1 << 9 | 1 << 5 | 1  # 1 January 1981, 0:00
UTF8 = 0x800


def deflated(data):
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    return packer.compress(data) + packer.flush()


def entries(base, more):
    with zipfile.ZipFile(base) as made:
        found = {i.filename: made.read(i) for i in made.infolist()}
    for argument in more:
        name, _, path = argument.partition("=")
        if name in found:
            sys.exit(f"{name} is there twice")
        with open(path, "rb") as file:
            found[name] = file.read()
    return sorted(found.items(), key=lambda entry: (entry[0] != "AndroidManifest.xml", entry[0]))


def main():
    base, out, *more = sys.argv[1:]
    parts = entries(base, more)
    central, offset = b"", 0
    with open(out, "wb") as file:
        for name, data in parts:
            align = next((a for end, a in STORED.items() if name.endswith(end)), 0)
            method, body = (0, data) if align else (8, deflated(data))
            raw, extra = name.encode(), b""
            if align:
                gap = -(offset + 30 + len(raw) + 6) % align
                extra = struct.pack("<HHH", 0xD935, 2 + gap, align) + bytes(gap)
            head = struct.pack("<HHHHHIIIHH", 20, UTF8, method, TIME, DATE, zlib.crc32(data), len(body), len(data), len(raw), len(extra))
            file.write(b"PK\3\4" + head + raw + extra + body)
            central += b"PK\1\2" + struct.pack("<H", 20) + head[:-2] + struct.pack("<HHHHII", 0, 0, 0, 0, 0, offset) + raw
            offset += 30 + len(raw) + len(extra) + len(body)
        file.write(central + b"PK\5\6" + struct.pack("<HHHHIIH", 0, 0, len(parts), len(parts), len(central), offset, 0))


if __name__ == "__main__":
    main()
