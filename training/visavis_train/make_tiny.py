"""Makes the tiny bundle that parity tests run on: random weights, real shapes. Deterministic for a seed.

    python -m visavis_train.make_tiny --out tests/goldens/tiny.safetensors
    python -m visavis_train.make_tiny --hearing --out tests/goldens/hearing.safetensors      one that hears the room
    python -m visavis_train.make_tiny --rest --out tests/goldens/rest.safetensors            one that is told how active a body at rest is, guided early only
"""
import argparse

import torch

from . import bundle
from .motion import features, rig
from .nets.appraisal import Appraisal
from .nets.audio import AudioEncoder

AUDIO = [(1, 4, 10, 5, False), (4, 8, 10, 5, False), (8, 8, 8, 4, False), (8, 8, 8, 4, False), (8, 8, 4, 2, False), (8, 8, 3, 1, True)]
VAE = {"layers": 2, "width": 24, "heads": 3, "mlp": 2, "latent": 8, "window_blocks": 6}
FLOW = {"layers": 2, "width": 32, "heads": 4, "mlp": 2, "tau_width": 16, "window_blocks": 6, "embed_latent": 16, "embed_user": 8,
        "embed_voice": 12, "embed_gaze": 4, "user_scale": 2.0}


def sway(frames):
    """A standing body that breathes, sways and turns its head a little: feature vectors [frames, F]."""
    import numpy as np
    t = np.arange(frames) / rig.FPS
    local = np.broadcast_to(np.eye(3), (frames, rig.J, 3, 3)).copy()
    at = rig.INDEX
    local[:, at["head"]] = rig.euler_yxz(0.3 * np.sin(1.3 * t), 0.1 * np.sin(0.9 * t), 0 * t)
    local[:, at["spine"]] = rig.euler_yxz(0.05 * np.sin(0.7 * t), 0.03 * np.sin(1.9 * t), 0.02 * np.sin(0.5 * t))
    local[:, at["leftUpperArm"]] = rig.axis_mat("z", -1.2 + 0.05 * np.sin(1.1 * t))
    local[:, at["rightUpperArm"]] = rig.axis_mat("z", 1.2 - 0.05 * np.sin(1.4 * t))
    local[:, at["hips"]] = rig.axis_mat("y", 0.04 * np.sin(0.6 * t))
    hips = np.stack([0.02 * np.sin(0.8 * t), 0.92 + 0.005 * np.sin(1.5 * t), 0.01 * np.sin(0.4 * t)], -1)
    rot = rig.local_to_global(local)
    return torch.tensor(features.to_features(rig.fk_global(hips, rot), rig.mat_to_quat(rot)), dtype=torch.float32)


def lively(net, scale=1.0):
    """Redraws every parameter so that no gate or modulation is zero and activations stay of order one."""
    with torch.no_grad():
        for name, p in net.named_parameters():
            if name.endswith("ln1.weight") or name.endswith("ln2.weight") or name.endswith("ln_f.weight"):
                p.copy_(1 + 0.1 * torch.randn_like(p))
            elif p.dim() == 1 or name.endswith("token") or name.endswith("slot"):
                p.normal_(0, 0.2)
            else:
                p.normal_(0, scale / p[0].numel() ** 0.5)
    return net.eval()


def build(seed=1, hearing=False, rest=False):
    torch.manual_seed(seed)
    x = sway(400)
    mean = x.mean(0)
    std = torch.full_like(mean, 0.02)
    std[3:] = x[:, 3:].reshape(-1, rig.J, 36).std(0).mean(-1).clamp(min=0.02).repeat_interleave(36)
    latent = VAE["latent"]
    vae = lively(bundle.vae_from(VAE, x.shape[1]))
    with torch.no_grad():
        vae.decoder.out.weight.mul_(0.5)
        vae.encoder.frame.weight.mul_(2)
    audio = lively(AudioEncoder(AUDIO, 8), 1.6)
    told = {"embed": 6, "levels": [[0.5, -0.3, 0.2]], "seconds": 10.0} if rest else None
    flow, student = (lively(bundle.flow_from(FLOW, latent, 8, rest=told)) for _ in range(2))
    tensors = {"stats.pose_mean": mean, "stats.pose_std": std, "idle.frames": x[:16],
               "stats.latent_mean": 0.1 * torch.randn(latent), "stats.latent_std": 0.5 + torch.rand(latent)}
    for prefix, net in (("audio", audio), ("vae", vae), ("flow", flow), ("student", student)):
        tensors |= bundle.net_tensors(prefix, net)
    heard = {}
    if hearing:
        appraisal = lively(Appraisal(6, ("stay", "look", "run"), 16), 1.6)
        room = {"audio": bundle.audio_config(AUDIO, 6), "embed": 8, "appraisal": {"width": appraisal.width, "reactions": list(appraisal.reactions)}}
        hearing = lively(AudioEncoder(AUDIO, 6), 1.6)
        tensors |= bundle.net_tensors("hearing", hearing) | appraisal.tensors()
        for prefix, net in (("flow", flow), ("student", student)):
            full = lively(bundle.flow_from(FLOW, latent, 8, room))
            tensors |= {k: v for k, v in bundle.net_tensors(prefix, full).items() if "_sound" in k}
        heard = {"hearing": room}
    config = bundle.make_config(
        bundle.rig_config(rig.NAMES, rig.PARENTS, rig.OFFSETS, rig.EYES, rig.HEAD_BACK), AUDIO, 8, VAE, FLOW, name="tiny",
        description="Random weights for tests; its motion means nothing.", licence="Same as the code.",
        student={"tau_history": 0.9375, "guidance": 1.3, "gaze_guidance": 2.5}, **heard)
    config["session"] = {"guidance": 1.3, "gaze_guidance": 2.5, "anchor_period": 0, "anchor_radius": 1000.0}
    if rest:
        config["rest"] = told
        config["session"]["guided_until"] = 0.3
    return tensors, config


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--hearing", action="store_true", help="networks hear the room")
    parser.add_argument("--rest", action="store_true", help="networks are told of the activity at rest; late evaluations are not guided")
    args = parser.parse_args()
    tensors, config = build(args.seed, args.hearing, args.rest)
    bundle.write(args.out, tensors, config, half=True)


if __name__ == "__main__":
    main()
