"""Checkpoints -> one bundle for the runtime.

    python -m visavis_train.export --corpus DIR --audio runs/audio.pt --vae runs/vae.pt --flow runs/flow.pt [--student runs/student.pt] --out B.safetensors [--half]

Averaged (EMA) weights are written. The idle clip, from which sessions start, is the calmest stretch of a real person at rest (of conversations where there is
no such clip): both feet planted, hands low and slow, facing the user; turned so that it ends facing +Z (features are relative, so nothing needs turning).
"""
import argparse
import os

import numpy as np
import torch

from . import bundle, credits
from .hearing import appraise
from .motion import rig
from .train.cache import load_audio, load_vae
from .train.data import clips, expand, load_motion
from .train.flow import load_flow
from .train.geometry import integrate, local_positions, to_world

DESCRIPTION = ("Conversation motion of a standing agent, trained on a corpus simulated from real clips and real speech (no captured conversations). "
               "Figures measured on it compare models with each other and are not those of the SARAH paper.")

NARROW = (".mod.",)  # from flow time to the norms' shifts and scales: f16 even in an f32 bundle, a sixth of the file with little effect


def restlessness(frames, roots, n):
    """How unquiet each window of `n` frames is [T - n + 1]: hand, foot and root speed, hands above the hips, turning."""
    x = expand(frames)
    p = to_world(roots.float(), local_positions(x))
    speed = torch.zeros(len(p), p.shape[1])
    speed[1:] = p.diff(dim=0).norm(dim=-1) * 30
    local = local_positions(x)
    lift = (local[:, [9, 13], 1] - local[:, :1, 1] + 0.02).clamp(min=0).sum(-1)
    apart = (local[:, [16, 20], 2]).abs().sum(-1)
    cost = speed[:, [9, 13]].sum(-1) + 4 * speed[:, [16, 20]].sum(-1) + 4 * frames[:, 2].abs() * 30 + 10 * lift + 2 * apart
    return cost.unfold(0, n, 1).mean(-1)


def idle_clip(corpus, split, n, limit=80, known=None):
    """Feature vectors [n, F] of the calmest stretch, and the name of its clip."""
    best = (np.inf, None, None)
    paths = clips(corpus, split)
    named = lambda kind: [p for p in paths if os.path.basename(p).startswith(kind)]
    for path in (named("idle") or named("talk"))[:limit]:
        clip, frames, roots, gaze = load_motion(path)
        cost = restlessness(frames, roots, n) + 0.5 * (1 - gaze.unfold(0, n, 1).mean(-1)).clamp(min=0)
        at = int(cost[1:].argmin()) + 1
        if cost[at] < best[0]:
            best = (float(cost[at]), expand(frames[at:at + n]), f"{path.split('/')[-1]}:{at}")
    return best[1], best[2]


def assemble(audio, vae_path, flow_path, student_path, idle, name, licence, session=None, hearing=None, appraisal=None):
    """Tensors and configuration of a bundle. `hearing`, `appraisal`: the encoder of what is heard in the room and what is made of it, of networks that
    hear it."""
    vae, mean, std, vae_state = load_vae(vae_path)
    flow, state = load_flow(flow_path)
    tensors = {"stats.pose_mean": mean, "stats.pose_std": std, "stats.latent_mean": state["latent_mean"], "stats.latent_std": state["latent_std"],
               "idle.frames": idle}
    nets = [("audio", audio), ("vae", vae), ("flow", flow)]
    student = None
    if student_path:
        net, s = load_flow(student_path)
        nets.append(("student", net))
        student = {k: s[k] for k in ("tau_history", "guidance", "gaze_guidance")}
    room = None
    if hearing is not None:
        nets.append(("hearing", hearing))
        tensors |= appraisal.tensors()
        room = bundle.room_config(hearing, appraisal, flow)
    for prefix, net in nets:
        tensors |= bundle.net_tensors(prefix, net)
    rig_json = bundle.rig_config(rig.NAMES, rig.PARENTS, rig.OFFSETS, rig.EYES, rig.HEAD_BACK)
    config = bundle.make_config(rig_json, audio.spec, audio.out.out_features, vae_state["size"], state["size"], name=name,
                                description=DESCRIPTION, licence=licence, student=student, session=session, hearing=room)
    return tensors, config


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    for name in ("corpus", "audio", "vae", "flow", "out"):
        parser.add_argument(f"--{name}", required=True)
    parser.add_argument("--student")
    parser.add_argument("--hearing", help="encoder of what is heard in the room (`hearing.encoder`), of a flow that was trained with it")
    parser.add_argument("--appraisal", help="which reaction that calls for (`hearing.appraise`), of a flow that was trained with it")
    parser.add_argument("--data", help="folder whose sounds/esc10/ATTRIBUTION.tsv names the makers of sounds, where a corpus has such")
    parser.add_argument("--sources", nargs="*", default=[], metavar="CORPUS", help="further corpora whose recordings are to be acknowledged")
    parser.add_argument("--name", default="base")
    parser.add_argument("--idle-frames", type=int, default=64)
    parser.add_argument("--idle-from", help="take the idle clip of this bundle")
    parser.add_argument("--half", action="store_true", help="f16 weights")
    for name in ("guidance", "gaze-guidance", "temperature", "guided-until"):
        parser.add_argument(f"--{name}", type=float, help="default of sessions")
    parser.add_argument("--student-temperature", type=float, help="of sessions on the student [as the others']")
    parser.add_argument("--reaction-guidance", type=float, default=1.0, help="how many times as far guidance goes while a sound is reacted to [1]")
    args = parser.parse_args()
    if (args.hearing is None) != (args.appraisal is None):
        raise SystemExit("--hearing and --appraisal belong together")
    if args.student_temperature is not None and not args.student:
        raise SystemExit("--student-temperature is a student's: give --student")
    if args.idle_frames % 4:
        raise SystemExit("--idle-frames must be a multiple of 4")
    if args.idle_from:
        idle = bundle.read(args.idle_from).idle()
    else:
        idle, where = idle_clip(args.corpus, "train", args.idle_frames)
        if idle is None:
            raise SystemExit(f"no clips of conversations or people at rest under {args.corpus}/train")
        print(f"idle clip from {where}")
    tensors, config = assemble(load_audio(args.audio), args.vae, args.flow, args.student, idle, args.name,
                               credits.licence(args.corpus, *args.sources, data=args.data),
                               {k: v for k in ("guidance", "gaze_guidance", "temperature", "guided_until") if (v := getattr(args, k)) is not None},
                               load_audio(args.hearing) if args.hearing else None, appraise.load(args.appraisal) if args.appraisal else None)
    if args.hearing:
        config["hearing"]["guidance"] = args.reaction_guidance
    if args.student_temperature is not None:
        config["student"]["temperature"] = args.student_temperature
    bundle.write(args.out, tensors, config, half=args.half, narrow=NARROW)
    print(f"{args.out}: {os.path.getsize(args.out) / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
