"""Everything the flow trains on, computed once: latents, roots, user, gaze and voice features of each clip.

    python -m visavis_train.train.cache --corpus DIR --vae runs/vae.pt --audio runs/audio.pt --out runs/cache

Writes OUT/{train,val}.pt. Latents are encoded at two phases (frame offsets 4 and 6), so that a window need not start where a clip does; with
`--phases 1` at one of them, in turn over the clips, for half the time. Without `--vae` the cache lacks latents; `--reuse` by a later call adds them.
"""
import argparse
import os

import torch

from ..corpus import store
from ..nets.audio import AudioEncoder
from ..nets.vae import Vae
from .team import Team
from .data import Motions, clips, expand, load_motion

PHASES = (4, 6)
CHUNK, OVERLAP, TOGETHER = 48, 24, 8  # the encoder sees 16 blocks a layer; more overlap changes latents by 0.2 % of their deviation


def load_vae(path):
    state = torch.load(path, weights_only=False)
    net = Vae(len(state["mean"]), **state["size"])
    net.load_state_dict(state["ema"])
    return net.eval(), state["mean"], state["std"], state


def load_audio(path):
    state = torch.load(path, weights_only=False)
    net = AudioEncoder(state["spec"], state["features"])
    net.load_state_dict(state["net"])
    return net.eval()


@torch.no_grad()
def encode(vae, x):
    """Standardised frames [4 K, F] -> encoder means [K, Dz], in overlapping chunks, several at a time."""
    blocks, at = len(x) // 4, {}
    for start in range(0, blocks, CHUNK):
        first, last = max(0, start - OVERLAP), min(blocks, start + CHUNK)
        at.setdefault((start - first, last - first), []).append(first)
    out = torch.empty(blocks, vae.encoder.mu.out_features)
    for (lead, length), firsts in at.items():
        for part in (firsts[i:i + TOGETHER] for i in range(0, len(firsts), TOGETHER)):
            with torch.autocast("cpu", torch.bfloat16):
                mu = vae.encoder(torch.stack([x[4 * f:4 * (f + length)] for f in part]))[0]
            for f, m in zip(part, mu.float()):
                out[f + lead:f + length] = m[lead:]
    return out


@torch.no_grad()
def listen(audio, voice, frames, chunk=1500):
    """i16 samples [800 T] or None -> features [T, D_a] f16."""
    if voice is None:
        return torch.zeros(frames, audio.out.out_features, dtype=torch.float16)
    wave, state = torch.from_numpy(voice).float()[None] / 32768, audio.state()
    parts = []
    for part in wave.split(800 * chunk, 1):
        with torch.autocast("cpu", torch.bfloat16):
            parts.append(audio(part, state)[0].half())
    return torch.cat(parts)


def features(audio, clip, frames):
    return {"agent": listen(audio, clip.agent_voice, frames), "voice": listen(audio, clip.user_voice, frames),
            "has": (clip.agent_voice is not None, clip.user_voice is not None)}


def relisten(cache, corpus, split, audio, team, out):
    """The cache's split with features of another audio encoder; all else as it is, without the voices."""
    state = torch.load(os.path.join(cache, split + ".pt"), weights_only=False, mmap=True)
    items = []
    for item in state["items"][team.rank::team.size]:
        clip = store.load(os.path.join(corpus, split, item["name"]))
        items.append({k: v for k, v in item.items() if k != "waves"} | features(audio, clip, len(item["gaze"])))
    items = team.gather(items, os.path.join(out, f"{split}.part"))
    if team.leads:
        torch.save(state | {"items": items}, os.path.join(out, split + ".pt"))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--corpus", required=True)
    parser.add_argument("--vae")
    parser.add_argument("--audio", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--conversations", type=int, help="take only this many of a split's conversations (and all captured takes)")
    parser.add_argument("--phases", type=int, default=2, choices=(1, 2))
    parser.add_argument("--workers", type=int, default=1, help="processes that share the clips")
    parser.add_argument("--waves", action="store_true", help="keep the voices too (i16), for flow training with --end-to-end")
    parser.add_argument("--reuse", metavar="CACHE", help="take everything but the latents from an earlier cache of this corpus (same audio encoder)")
    parser.add_argument("--relisten", metavar="CACHE", help="take everything but the voices' features from an earlier cache of this corpus (same VAE)")
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    team = Team(args.workers)
    vae, mean, std, _ = load_vae(args.vae) if args.vae else (None,) * 4
    audio = load_audio(args.audio)
    os.makedirs(args.out, exist_ok=True)
    stats = None
    for split in ("train", "val"):
        if args.relisten:
            relisten(args.relisten, args.corpus, split, audio, team, args.out)
            continue
        items, paths, known, poses = [], clips(args.corpus, split), {}, {}
        if args.reuse and not args.waves:
            known = {i["name"]: i for i in torch.load(os.path.join(args.reuse, split + ".pt"), weights_only=False, mmap=True)["items"]}
            poses = dict(zip(map(os.path.basename, paths), Motions(args.corpus, split).items))
        talks = [p for p in paths if os.path.basename(p).startswith("talk")]
        skip = set(talks[args.conversations:] if args.conversations else ())
        for n, path in list(enumerate(p for p in paths if p not in skip))[team.rank::team.size]:
            name = os.path.basename(path)
            if name in known:
                item, frames = dict(known[name]), poses[name]
            else:
                clip, frames, roots, gaze = load_motion(path)
                item = {"name": name, "roots": roots, "user": torch.from_numpy(clip.user_head.copy()), "gaze": gaze, **features(audio, clip, len(frames))}
            if len(frames) < 4 * 12 + 8:
                continue
            item["phases"] = PHASES if args.phases == 2 else PHASES[n // team.size % 2:][:1]
            x = (expand(frames) - mean) / std if vae else None
            item["z"] = [encode(vae, x[p:p + (len(x) - p) // 4 * 4]) for p in item["phases"]] if vae else []
            if args.waves:
                item["waves"] = [torch.from_numpy(v.copy()) if v is not None else None for v in (clip.agent_voice, clip.user_voice)]
            items.append(item)
        items = team.gather(items, os.path.join(args.out, f"{split}.part"))
        if not team.leads:
            continue
        if stats is None and vae:
            every = torch.cat([i["z"][0] for i in items])
            stats = every.mean(0), every.std(0).clamp(min=1e-3)
        for item in items:
            item["z"] = [(z - stats[0]) / stats[1] for z in item["z"]]
        torch.save({"items": items} | ({"latent_mean": stats[0], "latent_std": stats[1]} if vae else {}), os.path.join(args.out, split + ".pt"))
        print(f"{split}: {len(items)} clips, {sum(len(i['gaze']) for i in items) / 108000:.2f} hours", flush=True)
    team.close()


if __name__ == "__main__":
    main()
