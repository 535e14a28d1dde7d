"""What the flow trains on, computed once from a corpus: latents and voice features of each clip, with roots, user and gaze.

    python -m visavis_train.train.cache --corpus DIR --vae runs/vae.pt --audio runs/audio.pt --out runs/cache

Writes OUT/{train,val}.pt. Latents are encoded at two phases (frame offsets 4 and 6), so that a window need not start where a clip does. With --hearing,
of a corpus of `visavis_train.hearing.corpus`, also what was heard in the room; `--appraise CACHE --appraisal A` lays behind it what it calls for. `--join A B` makes one cache of several.
"""
import argparse
import os

import numpy as np
import torch

from ..corpus import measures, store
from ..hearing import appraise, ears
from ..motion import rig
from ..nets.audio import AudioEncoder
from ..nets.vae import codec
from . import common
from .common import mixed
from .data import Split
from .forms import FORMS
from .geometry import to_world
from .team import Team

PHASES = (4, 6)
CHUNK, OVERLAP = 48, 24  # the encoder sees 16 blocks a layer; more overlap changes latents by 0.2 % of their deviation
TOGETHER = {"cpu": 8, "cuda": 64}


def load_vae(path, device="cpu"):
    """Averaged network, mean and deviation of features, and the checkpoint."""
    state = common.load(path)
    net = codec(len(state["mean"]), state["size"])
    net.load_state_dict(state["ema"])
    return net.eval().to(device), state["mean"].to(device), state["std"].to(device), state


def load_audio(path, device="cpu"):
    """The averaged encoder of `train.audio`, or the one trained along with a flow."""
    state = common.load(path)
    net = AudioEncoder(state["spec"], state["features"])
    net.load_state_dict(state["beside"]["audio"]["ema"] if "audio" in state.get("beside", {}) else state["ema"])
    return net.eval().to(device)


@torch.no_grad()
def encode(vae, x):
    """Standardised frames [4 K, F] -> encoder means [K, Dz], in overlapping chunks, several at a time."""
    blocks, at, together = len(x) // 4, {}, TOGETHER[x.device.type]
    for start in range(0, blocks, CHUNK):
        first, last = max(0, start - OVERLAP), min(blocks, start + CHUNK)
        at.setdefault((start - first, last - first), []).append(first)
    out = torch.empty(blocks, vae.encoder.mu.out_features, device=x.device)
    for (lead, length), firsts in at.items():
        for part in (firsts[i:i + together] for i in range(0, len(firsts), together)):
            with mixed(x.device):
                mu = vae.encoder(torch.stack([x[4 * f:4 * (f + length)] for f in part]))[0]
            for f, m in zip(part, mu.float()):
                out[f + lead:f + length] = m[lead:]
    return out


@torch.no_grad()
def listen(audio, voice, frames, chunk=1500):
    """i16 samples [800 T], or None for silence -> features [T, D_a] f16, on the CPU."""
    voice = np.zeros(800 * frames, np.int16) if voice is None else voice
    device = audio.out.weight.device
    wave, state = torch.from_numpy(voice).to(device).float()[None] / 32768, audio.state()
    parts = []
    for part in wave.split(800 * chunk, 1):
        with mixed(device):
            parts.append(audio(part, state)[0].half().cpu())
    return torch.cat(parts)


def features(audio, clip, frames):
    return {"agent": listen(audio, clip.agent_voice, frames), "voice": listen(audio, clip.user_voice, frames),
            "has": (clip.agent_voice is not None, clip.user_voice is not None)}


@torch.no_grad()
def rooms(clips, encoder, gaze):
    """What was heard in the room in each clip: features [N, D_s] f16, levels [N, 2], source [N, 3], known [N], where the body reacts [N], sensitivity
    [clips], features of silence [D_s]; and the gaze score [N], its mean elsewhere in the clip while the body reacts: a target is for conversation."""
    frames, told = [], gaze.clone()
    sensitivity = torch.zeros(len(clips))
    for i, path in enumerate(clips.paths):
        with np.load(path.replace(".safetensors", ".npz")) as kept:
            wave = torch.from_numpy(kept["wave"]).float() / 32767
            sound, rest = ears.listen(encoder, wave), [torch.from_numpy(kept[k]) for k in ("levels", "place", "known", "reacts")]
            frames.append([sound.half()] + rest)
            part, reacts = slice(int(clips.starts[i]), int(clips.starts[i + 1])), frames[-1][-1]
            sensitivity[i] = float(kept["sensitivity"])
        if (~reacts).any():
            told[part] = torch.where(reacts, gaze[part][~reacts].mean(), gaze[part])
    sound, levels, source, known, reacts = (torch.cat(x) for x in zip(*frames))
    silence = ears.listen(encoder, torch.zeros(8 * ears.FRAME))
    return {"sound": sound, "levels": levels, "source": source, "known": known, "reacts": reacts, "sensitivity": sensitivity, "hears": torch.ones(len(clips), dtype=torch.bool),
            "silence": silence[-1], "gaze": told}


def appraised(state, appraisal):
    """A cache's tensors with the shares of the reactions behind the features of what is heard."""
    spans = zip(state["starts"][:-1].tolist(), state["starts"][1:].tolist(), state["sensitivity"].tolist())
    sound = [appraisal.behind(state["sound"][a:b].float(), state["levels"][a:b], s).half() for a, b, s in spans]
    silence = appraisal.behind(state["silence"].expand(8, -1), torch.full((8, 2), ears.SILENT), 0.0)[-1]
    return state | {"sound": torch.cat(sound), "silence": silence}


def join(caches, split):
    """One cache of several with the same standard of latents; clips without sounds hear nothing."""
    parts = [common.load(os.path.join(c, split + ".pt"), mmap=True) for c in caches]
    clip, frame, row, out = 0, 0, 0, {"names": [], "starts": [torch.zeros(1, dtype=torch.long)], "segments": []}
    hearing = next((p for p in parts if "sound" in p), None)
    for p in parts:
        if not torch.equal(p["latent_mean"], parts[0]["latent_mean"]):
            raise SystemExit("caches to be joined must have one standard: --standard FLOW")
        frames = int(p["starts"][-1])
        empty = {} if hearing is None else {k: torch.zeros(len(p["names"]) if k in ("sensitivity", "hears") else frames, *hearing[k].shape[1:], dtype=hearing[k].dtype)
                                            for k in ("sound", "levels", "source", "known", "reacts", "sensitivity", "hears")}
        for name in ("z", "has", "still", "roots", "user", "gaze", "agent", "voice", *empty):
            out.setdefault(name, []).append(p[name] if name in p else empty[name])
        out["names"] += p["names"]
        out["starts"].append(p["starts"][1:] + frame)
        out["segments"].append(p["segments"] + torch.tensor([clip, frame, row, 0]))
        clip, frame, row = clip + len(p["names"]), frame + frames, row + len(p["z"])
    joined = {k: v if k == "names" else torch.cat(v) for k, v in out.items()}
    return joined | {k: parts[0][k] for k in ("latent_mean", "latent_std")} | ({"silence": hearing["silence"]} if hearing else {})


def form_of(state):
    """What a frame is to the VAE of a checkpoint."""
    return FORMS[state.get("form", "icosahedra")]


def latents(clips, vae, mean, std, form, which):
    """{clip: [latents of each phase]} of clips `which`."""
    out = {}
    for i in which:
        x = (form.of(clips.frames[clips.starts[i]:clips.starts[i + 1]].to(mean.device)) - mean) / std
        out[i] = [encode(vae, x[p:p + (len(x) - p) // 4 * 4]).cpu() for p in PHASES]
    return out


def heard(clips, audio, which):
    """{clip: (agent's features, user's features)}."""
    out = {}
    for i in which:
        f = features(audio, store.load(clips.paths[i]), int(clips.starts[i + 1] - clips.starts[i]))
        out[i] = f["agent"], f["voice"]
    return out


def still(clips):
    """Frames [N] bool in which both hands are still."""
    out = []
    for a, b in zip(clips.starts[:-1].tolist(), clips.starts[1:].tolist()):
        frames, roots = clips.frames[a:b], clips.roots[a:b]
        p = to_world(roots, frames[:, 3:3 + 3 * rig.J].unflatten(1, (-1, 3)).double()).numpy()
        t = measures.tracks(p, rig.axis_mat("y", roots[:, 2].numpy())[:, None])
        out.append(torch.from_numpy((t["hand_v"] < measures.STILL).all(1)))
    return torch.cat(out)


def joined(clips, made, stats):
    """The file's tensors of all clips' latents; `stats` None: theirs become the standard."""
    rows, segments, at = [], [], 0
    for i in range(len(clips)):
        for phase, z in zip(PHASES, made[i]):
            segments.append((i, int(clips.starts[i]) + phase, at, len(z)))
            rows.append(z)
            at += len(z)
    z = torch.cat(rows)
    mean, std = stats or (z.mean(0), z.std(0).clamp(min=1e-3))
    return {"z": (z - mean) / std, "segments": torch.tensor(segments), "latent_mean": mean, "latent_std": std}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--corpus")
    parser.add_argument("--join", nargs="+", metavar="CACHE", help="caches to make one of, instead of a corpus")
    parser.add_argument("--hearing", help="encoder of what is heard in the room (`hearing.encoder`), for a corpus with sounds")
    parser.add_argument("--appraise", metavar="CACHE", help="cache to lay the answers of --appraisal behind, instead of a corpus")
    parser.add_argument("--appraisal", help="what says which reaction a sound calls for (`hearing.appraise`)")
    parser.add_argument("--vae", help="needed without --latents-of")
    parser.add_argument("--audio", help="needed without --features-of")
    parser.add_argument("--out", required=True)
    parser.add_argument("--latents-of", metavar="CACHE", help="take the latents of an earlier cache of this corpus: only the audio encoder has changed")
    parser.add_argument("--features-of", metavar="CACHE", help="take the voices' features of an earlier cache of this corpus: only the VAE has changed")
    parser.add_argument("--standard", metavar="FLOW", help="standardise latents as this flow's checkpoint does, not by their own mean and deviation")
    parser.add_argument("--splits", default="train,val")
    parser.add_argument("--workers", type=int, default=1, help="processes that share the clips")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    args = parser.parse_args()
    if not (args.corpus or args.join or args.appraise):
        parser.error("give --corpus, --join with caches, or --appraise with a cache")
    if bool(args.appraisal) != bool(args.appraise):
        parser.error("--appraise and --appraisal need each other")
    device, team = common.start_process(args), Team(args.workers)
    os.makedirs(args.out, exist_ok=True)
    if args.join or args.appraise:
        for split in args.splits.split(","):
            made = join(args.join, split) if args.join else appraised(common.load(os.path.join(args.appraise, split + ".pt")), appraise.load(args.appraisal))
            common.save(os.path.join(args.out, split + ".pt"), **made)
        return
    standard = common.load(args.standard) if args.standard else None
    stats = (standard["latent_mean"], standard["latent_std"]) if standard else None
    for split in args.splits.split(","):
        clips = team.first(lambda: Split(args.corpus, split, workers=args.workers))
        mine, state = range(team.rank, len(clips), team.size), {}
        for source, names in ((args.latents_of, ("z", "segments", "latent_mean", "latent_std")), (args.features_of, ("agent", "voice"))):
            if source:
                before = common.load(os.path.join(source, split + ".pt"), mmap=True)
                if before["names"] != clips.names:
                    raise SystemExit(f"{source} is not of this corpus' {split} clips")
                state |= {k: before[k] for k in names}
        if not args.latents_of:
            vae, mean, std, kept = load_vae(args.vae, device)
            parts = team.gather(latents(clips, vae, mean, std, form_of(kept), mine), os.path.join(args.out, f"{split}.part"))
            if team.leads:
                state |= joined(clips, parts, stats)
                stats = state["latent_mean"], state["latent_std"]
        if not args.features_of:
            parts = team.gather(heard(clips, load_audio(args.audio, device), mine), os.path.join(args.out, f"{split}.part"))
            if team.leads:
                state |= {name: torch.cat([parts[i][who] for i in range(len(clips))]) for who, name in enumerate(("agent", "voice"))}
        if team.leads:
            shared = {name: getattr(clips, name).clone() for name in ("roots", "user", "gaze")}
            if args.hearing:
                shared |= rooms(clips, load_audio(args.hearing), shared["gaze"])
            common.save(os.path.join(args.out, split + ".pt"), names=clips.names, starts=clips.starts, has=clips.has, still=still(clips), **shared, **state)
            print(f"{split}: {len(clips)} clips, {int(clips.starts[-1]) / 108000:.2f} hours", flush=True)
    team.close()


if __name__ == "__main__":
    main()
