"""What all workers start from: projected conditioning, noise, modulation, sizes, and the outputs of our f32 to check against."""
import json

import numpy as np
import torch
from safetensors import safe_open
from safetensors.numpy import save_file

from visavis_train.goldens import voices
from visavis_train.nets.flow import Condition, absent

STEPS = 4
BLOCKS = 12


def write_inputs(path, latent, idle):
    """Two voices, a user who circles, noise: an input of `visavis trace`."""
    r = np.random.default_rng(11)
    t = np.arange(4 * BLOCKS) / 30
    save_file({
        "agent_voice": voices(BLOCKS * 3200, 2).numpy(), "user_voice": voices(BLOCKS * 3200, 5).numpy(),
        "user_path": np.stack([1.2 * np.sin(0.8 * t), 1.6 + 0 * t, 1.5 + 0.4 * np.cos(1.1 * t)], -1).astype(np.float32),
        "eps": r.standard_normal((BLOCKS, latent)).astype(np.float32), "eps_idle": r.standard_normal((idle, latent)).astype(np.float32),
    }, path)


def tensors_of(path):
    with safe_open(path, framework="np") as f:
        return {k: f.get_tensor(k) for k in f.keys()}


@torch.no_grad()
def write(path, bundle, inputs, reference):
    """`bundle`: a read f32 bundle; `inputs`, `reference`: files given to and got from a trace."""
    given, ours = tensors_of(inputs), tensors_of(reference)
    net, audio = bundle.flow, bundle.config["audio"]["features"]
    wide, k = net.embed_latent.out_features, BLOCKS

    def heard(name, delay):
        rows = torch.zeros(k, 4 * audio)
        got = torch.tensor(ours[name]).reshape(-1, 4 * audio)
        rows[delay:] = got[:k - delay]
        return rows[None]

    def project(cond):
        full = net.conditioning(cond)[0]
        bias = net.input.bias + net.input.weight[:, :wide] @ net.embed_latent.bias
        return full @ net.input.weight[:, wide:].T + bias

    flags = torch.tensor(ours["conditioning.flags"])[None]
    cond = Condition(torch.tensor(ours["conditioning.user"])[None], heard("agent_features", bundle.config["agent_delay_blocks"]),
                     heard("user_features", bundle.config["user_delay_blocks"]), torch.zeros(1, k, 4), flags)
    idle = bundle.encode(bundle.idle()[None])[0]
    m = len(idle)
    nothing = absent(1, m + k, audio)
    without, with_ = project(nothing), torch.cat([project(absent(1, m, audio)), project(cond)])
    mods = []
    for i in range(2 * STEPS):
        c = net.tau_vector(torch.tensor([[i / (2 * STEPS)]]))
        rows = []
        for layer in net.layers:
            six = list(layer.modulation(c))
            six[1], six[4] = 1 + six[1], 1 + six[4]
            rows += six
        shift, scale = net.final["mod"](torch.nn.functional.silu(c)).chunk(2, -1)
        mods.append(torch.cat([*rows, shift, 1 + scale], 0).reshape(-1, net.width))
    f, v = bundle.config["flow"], bundle.config["vae"]
    sizes = {"idle": m, "blocks": k, "steps": STEPS, "latent": v["latent"], "guidance": bundle.config["session"]["guidance"],
             "flow": {n: f[n] for n in ("layers", "width", "heads", "mlp", "window_blocks")}, "decoder": {n: v[n] for n in ("layers", "width", "heads", "mlp", "window_blocks")},
             "features": 3 + 36 * bundle.joints}
    save_file({
        "cond": torch.stack([without, with_], 1).contiguous().numpy(), "mod": torch.stack(mods).numpy(),
        "eps": np.concatenate([given["eps_idle"], given["eps"]]), "idle": idle.numpy(), "latent_mean": bundle.stat("latent_mean").numpy(),
        "latent_std": bundle.stat("latent_std").numpy(), "latents": ours["latents"], "decoded": ours["decoded"],
    }, path, metadata={"sizes": json.dumps(sizes)})

