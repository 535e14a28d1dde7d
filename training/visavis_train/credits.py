"""Whose recordings are in a corpus: the licence text that goes into a bundle trained on it, and the model card's list."""
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
}
ALWAYS = ("cmu_",)   # arm shapes of every conversation come from there, and clips do not name them


def sources(corpus):
    """Prefixes of SOURCES that the clips under `corpus` (folders of .safetensors) name."""
    found = set()
    for folder, _, files in os.walk(corpus):
        for f in files:
            if f.endswith(".safetensors"):
                with safe_open(os.path.join(folder, f), framework="numpy") as clip:
                    names = json.loads((clip.metadata() or {}).get("sources", "[]"))
                found |= {p for p in SOURCES for n in names if isinstance(n, str) and n.startswith(p)}
    return found


def acknowledgements(corpus):
    """Acknowledgements of a corpus, in the order of SOURCES; those of the simulated corpus' fixed parts where it is one."""
    found = sources(corpus)
    if found:
        found |= set(ALWAYS)
    return [text for prefix, text in SOURCES.items() if prefix in found]


def licence(corpus):
    """The `licence` of a bundle trained on `corpus`."""
    texts = acknowledgements(corpus)
    return "Weights made from public material. " + " ".join(texts) if texts else "Weights made from the trainer's own recordings."
