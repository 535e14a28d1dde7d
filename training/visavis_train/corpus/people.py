"""Statistics of real people beside those of a corpus, printed and written as JSON for `visavis eval`.

    python -m visavis_train.corpus.people --data DATA [--corpus DIR] [--out people.json]

`real` are recordings measured on the rig after retargeting: idle are ten people who stand about and do not act, speaking
the gestures of one actress and one talking man, both without sound. Listening people are not among the data.
"""
import argparse
import json

import numpy as np

from ..motion import rig
from . import converse, measures, rest, store, voices
from .signals import FPS, gaussian

STANDS = 0.25      # m/s: a user whose head is slower stands
KINDS = ("idle", "listening", "speaking")


def real_rows(data):
    """{"idle": row, "speaking": row, "recordings": {name: row}} of real people."""
    tallies = {}
    for name in rest.REAL_ROW:
        t = rest.take(data, name)
        tallies[name] = measures.Tally()
        tallies[name].add(measures.tracks(t.positions, t.rotations))
    speaking = []
    t = rest.take(data, converse.ACCAD)
    mask = np.zeros(len(t.positions), bool)
    for a, b, kind in converse.SEGMENTS:
        mask[int(a * FPS): int(b * FPS)] |= kind not in ("nod", "shake")
    man = rest.take(data, converse.ROCKETBOX)
    lo, hi = (int(x * FPS) for x in converse.TALK)
    for take, where in ((t, mask), (man, (np.arange(len(man.positions)) >= lo) & (np.arange(len(man.positions)) < hi))):
        speaking.append(measures.Tally())
        speaking[-1].add(measures.tracks(take.positions, take.rotations), where)
    return {"idle": measures.mean_row(list(tallies.values())), "speaking": measures.mean_row(speaking),
            "recordings": {k: v.row() for k, v in tallies.items()}}


def phrases(clip, who):
    """Phrases [(start, end)] in seconds of a clip's `agent` or `user`: those it was made from, else found in the voice."""
    if f"{who}_phrases" in clip.meta:
        return [tuple(x) for x in json.loads(clip.meta[f"{who}_phrases"])]
    voice = getattr(clip, f"{who}_voice")
    if voice is None:
        return []
    return [(a / voices.RATE, b / voices.RATE) for a, b in voices.vad(voice / 32768.0)]


def stands(user, seconds=2.0):
    """[T] bool: the user has stood and will stand for `seconds`."""
    v = np.linalg.norm(np.gradient(gaussian(user, 4), axis=0), axis=1) * FPS
    return np.convolve((v > STANDS).astype(float), np.ones(2 * int(seconds * FPS) + 1), "same") < 0.5


class Conversations:
    """Tallies of conversation clips: idle (nobody speaks, the user stands), listening, speaking; nods; joins of the rest layers."""

    def __init__(self):
        self.tallies = {k: measures.Tally() for k in KINDS}
        self.nods, self.lags, self.joins = {}, [], [[], []]

    def add(self, clip):
        p, r = clip.positions.astype(float), rig.quat_to_mat(clip.rotations)
        agent, user = phrases(clip, "agent"), phrases(clip, "user")
        t = measures.tracks(p, r)
        for k, mask in measures.states(agent, user, len(p)).items():
            self.tallies[k].add(t, mask & stands(clip.user_head) if k == "idle" else mask)
        counts, lags = measures.listener(measures.head_pitch(r), agent, user, len(p))
        for k, (n, seconds) in counts.items():
            old = self.nods.setdefault(k, [0, 0.0])
            old[0] += n
            old[1] += seconds
        self.lags += lags
        if "joins" in clip.meta:
            self.joins[0].append(join_accelerations(p, json.loads(clip.meta["joins"]), True))
            self.joins[1].append(join_accelerations(p, json.loads(clip.meta["joins"]), False))

    def row(self):
        """Measures of each state, nods a minute of each state of the user, lags' quartiles, acceleration at joins to elsewhere."""
        out = {k: t.row() for k, t in self.tallies.items()}
        out["nods_per_minute"] = {k: 60 * n / s if s else float("nan") for k, (n, s) in self.nods.items()}
        out["nod_lag"] = [float(x) for x in np.quantile(self.lags, (0.25, 0.5, 0.75))] if self.lags else []
        at, off = (np.concatenate(x) if x else np.zeros(0) for x in self.joins)
        out["joins"] = float(at.mean() / off.mean()) if len(at) and len(off) else float("nan")
        return out


def join_accelerations(positions, joins, inside):
    """Mean joint acceleration [n] of frames within (or outside) the change-overs [(start, end)]."""
    a = np.linalg.norm(np.diff(positions, 2, axis=0), axis=-1).mean(1) * FPS ** 2
    mask = np.zeros(len(a), bool)
    for x, y in joins:
        mask[x:y] = True
    return a[mask if inside else ~mask]


def corpus_rows(folder, splits=("train", "val", "test"), limit=None):
    """{split: row of `Conversations`} of the talk clips of a corpus, the first `limit` of each split if given."""
    out = {}
    for split in splits:
        c = Conversations()
        for path in [p for p in store.list_clips(folder, split) if "/talk_" in p.replace("\\", "/")][:limit]:
            clip = store.load(path, voices=False)
            c.add(clip if "agent_phrases" in clip.meta else store.load(path))
        out[split] = c.row()
    return out


def lines(name, row):
    """Text of one row of measures."""
    levels = ", ".join(f"{k.replace('_', ' ')} {row[k]:.3f}" for k in measures.LEVEL_NAMES)
    spectra = "; ".join(f"{k} " + " ".join(f"{x:.4f}" for x in row[f"{k}_spectrum"]) for k in ("hand", "head") if row[f"{k}_spectrum"])
    still = " ".join(f"{x:.1f}" for x in row["still_seconds"])
    return [f"  {name} ({row['seconds']:.0f} s): {levels}", f"    still stretches p25/50/75/90 {still} s; spectra (m/s in {measures.BANDS} Hz) {spectra}"]


def talk_lines(row):
    """Text of a row of `Conversations`."""
    out = [x for k in KINDS if row[k]["seconds"] for x in lines(k, row[k])]
    nods = ", ".join(f"{k} {x:.1f}" for k, x in row["nods_per_minute"].items())
    lag = ", lag p25/50/75 " + " ".join(f"{x:.2f}" for x in row["nod_lag"]) + " s" if row["nod_lag"] else ""
    return out + [f"  nods a minute: {nods}{lag}; acceleration at joins to elsewhere {row['joins']:.2f}"]


def main():
    ap = argparse.ArgumentParser(prog="python -m visavis_train.corpus.people", description=__doc__.split("\n")[0])
    ap.add_argument("--data", required=True, help="folder with motion/")
    ap.add_argument("--corpus", help="corpus whose conversations are measured too")
    ap.add_argument("--limit", type=int, help="at most this many conversations of each split")
    ap.add_argument("--out", help="JSON to write")
    a = ap.parse_args()
    got = {"real": real_rows(a.data), "bands_hz": list(measures.BANDS), "still_quantiles": list(measures.QUANTILES)}
    for k in ("idle", "speaking"):
        print("\n".join(lines("real people, " + k, got["real"][k])))
    if a.corpus:
        got["corpus"] = corpus_rows(a.corpus, limit=a.limit)
        for split, row in got["corpus"].items():
            print("\n".join([f"corpus, {split}"] + talk_lines(row)))
    if a.out:
        with open(a.out, "w", encoding="utf-8") as f:
            json.dump(_rounded(got), f, indent=1)
            f.write("\n")


def _rounded(x):
    """Four significant digits; NaN becomes null."""
    if isinstance(x, dict):
        return {k: _rounded(v) for k, v in x.items()}
    if isinstance(x, (list, tuple)):
        return [_rounded(v) for v in x]
    return x if not isinstance(x, float) else float(f"{x:.4g}") if np.isfinite(x) else None


if __name__ == "__main__":
    main()
