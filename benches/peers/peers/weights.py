"""Seeded weights of any size as a bundle of f32; `ours quantize` makes the others of it."""
import json
import zlib

import numpy as np
from safetensors.numpy import save_file


def values(name, shape):
    """Uniform within one over the root of the row's length, by the name alone; deviations are 1."""
    if name.endswith("_std"):
        return np.ones(shape, np.float32)
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    fan = int(np.prod(shape[1:])) if len(shape) > 1 else 4 * shape[0]
    if name.endswith((".ln1.weight", ".ln2.weight", ".ln_f.weight")):
        return (1 + 0.1 * rng.uniform(-1, 1, shape)).astype(np.float32)
    return (rng.uniform(-1, 1, shape) / np.sqrt(fan)).astype(np.float32)


def shapes(config, idle):
    """Names and shapes of all tensors of a bundle."""
    def linear(name, out, inp):
        return {f"{name}.weight": (out, inp), f"{name}.bias": (out,)}

    def layer(name, d, mlp):
        return linear(f"{name}.qkv", 3 * d, d) | linear(f"{name}.proj", d, d) | linear(f"{name}.fc1", mlp * d, d) | linear(f"{name}.fc2", d, mlp * d)

    features, dz, audio = 3 + 36 * len(config["rig"]["joints"]), config["vae"]["latent"], config["audio"]["features"]
    out = {"stats.pose_mean": (features,), "stats.pose_std": (features,), "stats.latent_mean": (dz,), "stats.latent_std": (dz,), "idle.frames": (idle, features)}
    for i, c in enumerate(config["audio"]["layers"]):
        out |= {f"audio.conv.{i}.weight": (c["outputs"], c["kernel"], c["inputs"]), f"audio.conv.{i}.bias": (c["outputs"],)}
    out |= linear("audio.out", audio, config["audio"]["layers"][-1]["outputs"])
    v = config["vae"]
    for side, tokens in (("encoder", 6), ("decoder", 5)):
        d, p = v["width"], f"vae.{side}"
        for i in range(v["layers"]):
            out |= layer(f"{p}.layers.{i}", d, v["mlp"])
            out |= {f"{p}.layers.{i}.{n}.{w}": (d,) for n in ("ln1", "ln2") for w in ("weight", "bias")}
        out |= {f"{p}.ln_f.weight": (d,), f"{p}.ln_f.bias": (d,), f"{p}.slot": (tokens, d)}
    d = v["width"]
    out |= linear("vae.encoder.frame", d, features) | {"vae.encoder.mu_token": (d,), "vae.encoder.sigma_token": (d,)}
    out |= linear("vae.encoder.mu", dz, d) | linear("vae.encoder.logvar", dz, d)
    out |= linear("vae.decoder.latent", d, dz) | {"vae.decoder.frame_token": (4, d)} | linear("vae.decoder.out", features, d)
    for net in ("flow", "student") if config["student"] else ("flow",):
        f = config["flow"]
        d, t = f["width"], f["tau_width"]
        out |= linear(f"{net}.embed_latent", f["embed_latent"], dz) | linear(f"{net}.embed_user.0", f["embed_user"], 8)
        out |= linear(f"{net}.embed_user.2", f["embed_user"], f["embed_user"]) | linear(f"{net}.embed_gaze", f["embed_gaze"], 4)
        out |= linear(f"{net}.embed_agent", f["embed_voice"], 4 * audio) | linear(f"{net}.embed_voice", f["embed_voice"], 4 * audio)
        out |= linear(f"{net}.input", d, f["embed_latent"] + f["embed_user"] + 2 * f["embed_voice"] + f["embed_gaze"] + 4)
        out |= linear(f"{net}.tau.0", t, t) | linear(f"{net}.tau.2", t, t)
        for i in range(f["layers"]):
            out |= layer(f"{net}.layers.{i}", d, f["mlp"]) | linear(f"{net}.layers.{i}.mod", 6 * d, t)
        out |= linear(f"{net}.final.mod", 2 * d, t) | linear(f"{net}.final.out", dz, d)
    return out


def write(path, config, idle=8):
    """Draws and writes a bundle of `config`, with `idle` frames of idle clip."""
    tensors = {name: values(name, shape) for name, shape in shapes(config, idle).items()}
    save_file(tensors, path, metadata={"visavis": json.dumps(config)})
