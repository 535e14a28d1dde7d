#!/usr/bin/env python3
"""usage: checkapk.py FILE.apk ANDROIDDIR
A signed APK by its bytes, and against the Gradle project: what is stored and where, ELF, dex, signing block; version, levels, assets and sources
as android/demo's Gradle file and folders state them."""
import hashlib
import pathlib
import re
import struct
import subprocess
import sys
import zipfile
import zlib

SCHEMES = {0x7109871A: "v2", 0xF05368C0: "v3"}
PADDING = 0x42726577
ARM64 = 183


def entries(archive, data):
    for i in archive.infolist():
        name, extra = struct.unpack_from("<HH", data, i.header_offset + 26)
        at = i.header_offset + 30 + name + extra
        stored = not i.compress_type
        must = 16384 if i.filename.endswith(".so") else 4 if i.filename.endswith((".arsc", ".safetensors", ".wav")) else 0
        if must and not stored:
            yield f"{i.filename} is compressed"
        if must and at % must:
            yield f"{i.filename} lies at {at}, no multiple of {must}"
        print(f"  {i.filename:44} {'stored' if stored else 'deflated':9} {i.file_size:>9} -> {i.compress_size:>9} at {at}")


def library(name, so):
    if so[:5] != b"\x7fELF\2" or struct.unpack_from("<H", so, 18)[0] != ARM64:
        yield f"{name} is no arm64 library"
        return
    table, (size, count) = struct.unpack_from("<Q", so, 32)[0], struct.unpack_from("<HH", so, 54)
    for i in range(count):
        kind, align = struct.unpack_from("<I", so, table + i * size)[0], struct.unpack_from("<Q", so, table + i * size + 48)[0]
        if kind == 1 and align < 16384:
            yield f"{name}: a segment is aligned to {align}, too little for pages of 16 KiB"


def signatures(data):
    directory = struct.unpack_from("<I", data, data.rindex(b"PK\5\6") + 16)[0]
    if data[directory - 16:directory] != b"APK Sig Block 42":
        return set()
    at, found = directory - struct.unpack_from("<Q", data, directory - 24)[0], set()
    while at < directory - 24:
        length, scheme = struct.unpack_from("<QI", data, at)
        if scheme != PADDING:
            found.add(SCHEMES.get(scheme, hex(scheme)))
        at += 8 + length
    return found


def gradle(android, badging, names, kept, dex):
    script = (android / "demo/build.gradle.kts").read_text()
    said = lambda key: re.search(rf'{key} = "?([\w.]+)', script)[1]
    shown = lambda pattern: (re.search(pattern, badging) or [None, None])[1]
    for what, want, found in [
        ("package", said("applicationId"), shown(r"package: name='([^']*)'")),
        ("versionCode", said("versionCode"), shown(r"versionCode='([^']*)'")),
        ("versionName", said("versionName"), shown(r"versionName='([^']*)'")),
        ("minSdk", said("minSdk"), shown(r"sdkVersion:'([^']*)'")),
        ("targetSdk", said("targetSdk"), shown(r"targetSdkVersion:'([^']*)'")),
    ]:
        if want != found:
            yield f"{what} is {found}, Gradle's {want}"
    assets = {"assets/" + n for group in re.findall(r"(?:include|resolve)\(([^)]*)\)", script) for n in re.findall(r'"([^"]*)"', group)}
    if assets != {n for n in names if n.startswith("assets/")}:
        yield f"assets are not Gradle's: {sorted(assets)}"
    stored = set(re.findall(r'"(\w+)"', re.search(r"noCompress \+= listOf\(([^)]*)\)", script)[1]))
    if {n.rpartition(".")[2] for n in kept} != stored:
        yield f"stored assets {sorted(kept)}, Gradle's {sorted(stored)}"
    sources = {str(f.relative_to(root))[:-5] for root in (android / "visavis/src/main/java", android / "demo/src/main/java")
               for f in root.rglob("*.java") if f.name != "package-info.java"}
    classes = {c.split("$")[0] for c in dex} - {"org/visavis/demo/R"}
    if classes != sources:
        yield f"classes are not Gradle's sources: {sorted(classes ^ sources)}"


def main():
    apk, android = sys.argv[1], pathlib.Path(sys.argv[2])
    data = pathlib.Path(apk).read_bytes()
    archive, bad = zipfile.ZipFile(apk), []
    if archive.testzip():
        bad.append(f"{archive.testzip()} is damaged")
    names = archive.namelist()
    if len(set(names)) != len(names):
        bad.append("an entry is there twice")
    bad += entries(archive, data)
    libraries = [n for n in names if n.startswith("lib/")]
    if libraries != ["lib/arm64-v8a/libvisavis_jni.so"]:
        bad.append(f"libraries: {libraries}")
    for name in libraries:
        bad += library(name, archive.read(name))
    dex = archive.read("classes.dex")
    if dex[:4] != b"dex\n" or zlib.adler32(dex[12:]) != struct.unpack_from("<I", dex, 8)[0] or hashlib.sha1(dex[32:]).digest() != dex[12:32]:
        bad.append("classes.dex: magic, checksum or signature")
    if dex[4:7] > b"039":
        bad.append(f"classes.dex has version {dex[4:7].decode()}, newer than API 29 reads")
    if signatures(data) != {"v2", "v3"}:
        bad.append(f"signatures: {sorted(signatures(data))}")
    run = lambda *command: subprocess.run(command, capture_output=True, text=True, check=True).stdout
    listed = re.findall(r"Class descriptor  : 'L([^;]+);'", run("dexdump", apk))
    kept = [i.filename for i in archive.infolist() if i.filename.startswith("assets/") and not i.compress_type]
    bad += gradle(android, run("aapt", "dump", "badging", apk), names, kept, listed)
    print(f"{apk}: {len(data)} bytes, dex {dex[4:7].decode()}, {len(listed)} classes, signed {' and '.join(sorted(signatures(data)))}")
    for text in bad:
        print("BAD:", text)
    return bool(bad)


if __name__ == "__main__":
    sys.exit(main())
