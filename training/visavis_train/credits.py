"""Whose recordings are in a corpus: the licence text that goes into a bundle trained on it, and the model card's list."""
import csv
import json
import os

from safetensors import safe_open

# first part of a clip's source: (acknowledgement, whether it is asked for in so many words)
SOURCES = {
    "cmu_": "Motion: the data used in this project was obtained from mocap.cs.cmu.edu; the database was created with funding from NSF EIA-0196217. "
            "It may not be resold, even in converted form.",
    "reactidle/": "Motion: ReActIdle, MIT, Copyright (c) 2025 RSAIT (University of the Basque Country, UPV/EHU).",
    "accad_female1/": "Motion: Open Motion Project, ACCAD / The Ohio State University, CC BY 3.0 (creativecommons.org/licenses/by/3.0); retargeted.",
    "rocketbox/": "Motion: Microsoft Rocketbox and MoveBox for Microsoft Rocketbox, MIT, Copyright (c) Microsoft Corporation.",
    "ljspeech/": "Voices: LJ Speech, public domain.",
    "ami/": "Voices: the AMI Corpus, CC BY 4.0 (creativecommons.org/licenses/by/4.0); excerpts, mixed and resampled.",
    "dyadic/": "Voices: dyadic calls, Apache-2.0, Copyright Amazon.com, Inc. or its affiliates.",
    "azure/": "Voices: samples of Microsoft's speech services, MIT, Copyright (c) Microsoft Corporation.",
    "music/": "Music: own tunes, played with the FluidR3 soundfont, MIT, Copyright (c) 2000-2002, 2008 Frank Wen.",
}
ALWAYS = ("cmu_",)   # arm shapes of every conversation come from there, and clips do not name them


def names(corpus):
    """Recordings that the clips under `corpus` (folders of .safetensors) name."""
    found = set()
    for folder, _, files in os.walk(corpus):
        for f in files:
            if f.endswith(".safetensors"):
                with safe_open(os.path.join(folder, f), framework="numpy") as clip:
                    found |= {n for n in json.loads((clip.metadata() or {}).get("sources", "[]")) if isinstance(n, str)}
    return found


def acknowledgements(used, data=None):
    """Acknowledgements of recordings by name, in the order of SOURCES; those of the simulated corpus' fixed parts where it is one. Clips of ESC-10 are
    named by their makers, from DATA/sounds/esc10/ATTRIBUTION.tsv."""
    found = {p for p in SOURCES for n in used if n.startswith(p)}
    if found:
        found |= set(ALWAYS)
    texts = [text for prefix, text in SOURCES.items() if prefix in found]
    if sounds := {n for n in used if n.startswith("esc10/")}:
        if not data:
            raise SystemExit("the corpus has sounds of ESC-10: --data is needed, whose sounds/esc10/ATTRIBUTION.tsv says who made them")
        with open(os.path.join(data, "sounds", "esc10", "ATTRIBUTION.tsv"), encoding="utf-8") as f:
            makers = {r["by"] for r in csv.DictReader(f, delimiter="\t") if r["licence"] != "CC0" and any(n.endswith("/" + r["file"]) for n in sounds)}
        texts.append("Sounds: ESC-10 (K. J. Piczak, ESC: Dataset for Environmental Sound Classification, 2015), clips of Freesound under CC0 and, cut and rendered, "
                     "under CC BY 3.0 by " + ", ".join(sorted(makers)) + ".")
    return texts


def statement(used, data=None):
    """The `licence` of a bundle trained on recordings of these names."""
    texts = acknowledgements(used, data)
    return "Weights made from public material. " + " ".join(texts) if texts else "Weights made from the trainer's own recordings."


def licence(*corpora, data=None):
    """The `licence` of a bundle trained on corpora."""
    return statement(set().union(*map(names, corpora)), data)
