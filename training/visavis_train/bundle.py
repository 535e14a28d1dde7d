"""Reading and writing bundles: one safetensors file, the configuration (src/config.rs) as JSON in its metadata."""
import json
import os
from dataclasses import dataclass

import numpy as np
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from .nets.appraisal import Appraisal
from .nets.audio import AudioEncoder
from .nets.flow import FlowNet
from .nets.vae import Vae

FORMAT = 1
SESSION = {"guidance": 1.5, "gaze_guidance": 2.0, "temperature": 0.75, "clean_history": {"tau": 0.9, "from": 0.3}, "anchor_period": 90,
           "anchor_radius": 8.0}
KEY = "visavis"


def temperature(config, student=False):
    """Scale of the noise in sessions on the reference sampler or the student."""
    own = (config.get("student") or {}).get("temperature") if student else None
    return config["session"].get("temperature", 1.0) if own is None else own


def _rename(name):
    """Module path -> tensor name of the bundle: attention projections sit directly in the layer."""
    return name.replace(".attn.", ".")


def net_tensors(prefix, net):
    """Tensors of a network under the bundle's names; convolutions become [out, kernel, in]."""
    out = {}
    for name, value in net.state_dict().items():
        value = value.detach().float()
        if value.dim() == 3:
            value = value.permute(0, 2, 1)
        out[f"{prefix}.{_rename(name)}"] = value.contiguous()
    return out


def load_net(prefix, net, tensors):
    """Fills a network from a bundle's tensors (f16 is widened)."""
    state = {}
    for name, value in net.state_dict().items():
        key = f"{prefix}.{_rename(name)}"
        if key not in tensors:
            raise KeyError(f"the bundle lacks {key}")
        t = tensors[key].float()
        t = t.permute(0, 2, 1) if value.dim() == 3 else t
        if t.shape != value.shape:
            raise ValueError(f"{key} has shape {tuple(t.shape)}, the configuration asks for {tuple(value.shape)}")
        state[name] = t
    net.load_state_dict(state)
    return net.eval()


def write(path, tensors, config, half=False, narrow=()):
    """Writes beside `path` and renames, so that a reader never sees half a file. Tensors whose name holds one of `narrow` are f16 in any case."""
    dtype = torch.float16 if half else torch.float32
    tensors = {k: v.detach().to(torch.float16 if any(n in k for n in narrow) else dtype).contiguous().clone() for k, v in tensors.items()}
    bad = [k for k, v in tensors.items() if not torch.isfinite(v).all()]
    if bad:
        raise ValueError(f"not finite: {', '.join(bad)}")
    temporary = f"{path}.tmp"
    save_file(tensors, temporary, metadata={KEY: json.dumps(config)})
    os.chmod(temporary, 0o644)
    os.replace(temporary, path)


@dataclass
class Bundle:
    config: dict
    tensors: dict
    audio: AudioEncoder
    vae: Vae
    flow: FlowNet
    student: FlowNet | None
    hearing: AudioEncoder | None   # what is heard in the room
    appraisal: Appraisal | None        # which reaction that calls for

    def stat(self, name):
        return self.tensors[f"stats.{name}"].float()

    @property
    def joints(self):
        return len(self.config["rig"]["joints"])

    def standardise(self, x):
        return (x - self.stat("pose_mean")) / self.stat("pose_std")

    def unstandardise(self, x):
        return x * self.stat("pose_std") + self.stat("pose_mean")

    def encode(self, x):
        """Feature vectors [B, 4 K, F] in metres -> standardised latents [B, K, Dz]."""
        return (self.vae.encoder(self.standardise(x))[0] - self.stat("latent_mean")) / self.stat("latent_std")

    def decode(self, z):
        """Standardised latents [B, K, Dz] -> standardised frames [B, 4 K, F]."""
        return self.vae.decoder(z * self.stat("latent_std") + self.stat("latent_mean"))

    def idle(self):
        """Frames of the idle clip, metres; of a quantised bundle, which holds their latents alone, what the decoder makes of them."""
        if "idle.latents" in self.tensors:
            with torch.no_grad():
                return self.unstandardise(self.decode(self.tensors["idle.latents"].float()[None])[0])
        return self.tensors["idle.frames"].float()


def flow_from(config, latent, audio_features, hearing=None, rest=None):
    """The network of a `flow` section; `hearing`, `rest`: those sections of the bundle, if it has them."""
    keys = ("layers", "width", "heads", "mlp", "tau_width", "window_blocks", "embed_latent", "embed_user", "embed_voice", "embed_gaze", "user_scale")
    sound = {"sound_features": sound_features(hearing), "embed_sound": hearing["embed"]} if hearing else {}
    return FlowNet(latent, audio_features, **{k: config[k] for k in keys}, **sound, embed_activity=rest["embed"] if rest else 0)


def sound_features(hearing):
    """Features of a frame that a flow is told of the room by a `hearing` section, or None: the encoder's, and the shares of reactions behind them."""
    return hearing["audio"]["features"] + len(hearing["appraisal"]["reactions"]) if hearing else 0


def encoder_from(config):
    """The network of an `audio` section."""
    layers = [tuple(c[k] for k in ("inputs", "outputs", "kernel", "stride", "residual")) for c in config["layers"]]
    return AudioEncoder(layers, config["features"])


def audio_config(spec, features):
    """An `audio` section."""
    return {"layers": [dict(zip(("inputs", "outputs", "kernel", "stride", "residual"), s)) for s in spec], "features": features}


def vae_from(config, features):
    return Vae(features, **{k: config[k] for k in ("latent", "layers", "width", "heads", "mlp", "window_blocks")})


def dequantised(tensors):
    """Tensors of a bundle with int8 weights as floats: each row times its scale."""
    out = {k: v for k, v in tensors.items() if not k.endswith(".scale")}
    for name, w in out.items():
        scale = tensors.get(name.removesuffix(".weight") + ".scale")
        if scale is None or not name.endswith(".weight"):
            continue
        if w.dtype != torch.int8:
            raise ValueError(f"{name} is of {w.dtype}: int4 is too coarse to go on from, read the bundle that it was made of")
        out[name] = w.float() * scale.float().reshape(-1, *[1] * (w.dim() - 1))
    return out


def room_config(encoder, appraisal, flow):
    """A `hearing` section."""
    return {"audio": audio_config(encoder.spec, encoder.out.out_features), "embed": flow.embed_sound["2"].out_features,
            "appraisal": {"width": appraisal.width, "reactions": list(appraisal.reactions)}}


def read(path):
    """Opens a bundle (f32, f16 or int8) and builds its networks in fp32."""
    with safe_open(path, framework="pt") as f:
        config = json.loads(f.metadata()[KEY])
        tensors = {k: f.get_tensor(k) for k in f.keys()}
    if config["format"] != FORMAT:
        raise ValueError(f"{path} has format {config['format']}, this code reads {FORMAT}")
    tensors = dequantised(tensors)
    features = 3 + 36 * len(config["rig"]["joints"])
    hearing = config.get("hearing")
    net = lambda: flow_from(config["flow"], config["vae"]["latent"], config["audio"]["features"], hearing, config.get("rest"))
    return Bundle(
        config, tensors,
        load_net("audio", encoder_from(config["audio"]), tensors),
        load_net("vae", vae_from(config["vae"], features), tensors),
        load_net("flow", net(), tensors),
        load_net("student", net(), tensors) if config.get("student") else None,
        load_net("hearing", encoder_from(hearing["audio"]), tensors) if hearing else None,
        Appraisal(hearing["audio"]["features"], **hearing["appraisal"]).fill(tensors) if hearing else None)


def make_config(rig, audio_layers, audio_features, vae, flow, *, name, description, licence, student=None, radius=0.1, session=None, hearing=None):
    """The configuration in the shape of src/config.rs. `vae` and `flow` are dicts of their fields, `session` of those that differ from `SESSION`;
    `hearing` the section of bundles that hear the room."""
    return {
        "format": FORMAT, "name": name, "description": description, "licence": licence,
        "user_delay_blocks": 1, "agent_delay_blocks": 0, "rig": rig, "pose": {"radius": radius},
        "audio": audio_config(audio_layers, audio_features),
        "vae": vae, "flow": flow, "student": student,
        "session": SESSION | (session or {}),
    } | ({"hearing": hearing} if hearing else {})


def rig_config(names, parents, offsets, eyes, head_back):
    joints = [{"name": n, "parent": None if p < 0 else int(p), "offset": [float(v) for v in o]} for n, p, o in zip(names, parents, np.asarray(offsets))]
    return {"joints": joints, "eyes": [float(v) for v in eyes], "head_back": [float(v) for v in head_back]}
