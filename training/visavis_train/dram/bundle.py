"""Bundles of kind `dram`: names, layouts and configuration as the runtime reads them."""
import json
from dataclasses import dataclass

from safetensors import safe_open

from .. import bundle as bundles
from ..nets.audio import AudioEncoder
from ..nets.lstm import packed, unpacked
from .nets import Dram
from .pose import Layout

STATS = {"mean": "pose_mean", "std": "pose_std", "step": "step_std"}


def tensors_of(net):
    """Networks under the bundle's names: convolutions [out, kernel, in], an LSTM layer's two matrices side by side and one bias."""
    out = {f"stats.{STATS[name]}": getattr(net, name) for name in STATS}
    for part in ("monadic", "dyadic"):
        module = getattr(net, part)
        for name, value in module.state_dict().items():
            if not name.startswith("lstm."):
                value = value.permute(0, 2, 1) if value.dim() == 3 else value
                out[f"{part}.{name}"] = value.detach().float().contiguous()
        if net.kind == "lstm":
            for i in range(module.lstm.num_layers):
                out[f"{part}.lstm.{i}.weight"], out[f"{part}.lstm.{i}.bias"] = packed(module.lstm, i)
    return out


def fill(net, tensors):
    """The inverse of `tensors_of`."""
    state = {name: tensors[f"stats.{STATS[name]}"].float() for name in STATS}
    for name, value in net.state_dict().items():
        part, _, rest = name.partition(".")
        if name in STATS:
            continue
        if rest.startswith("lstm."):
            which = rest.removeprefix("lstm.")
            i = which.rsplit("_l", 1)[1]
            state[name] = unpacked(tensors[f"{part}.lstm.{i}.weight"], tensors[f"{part}.lstm.{i}.bias"], i)[which]
        else:
            t = tensors[name].float()
            state[name] = t.permute(0, 2, 1) if value.dim() == 3 else t
    net.load_state_dict(state)
    return net.eval()


def config(rig, encoder, backbone, sizes, *, name, description, licence, session=None):
    layers = [dict(zip(("inputs", "outputs", "kernel", "stride", "residual"), s)) for s in encoder.spec]
    return {"format": bundles.FORMAT, "kind": "dram", "name": name, "description": description, "licence": licence, "user_delay_blocks": 1,
            "agent_delay_blocks": 0, "rig": rig, "audio": {"layers": layers, "features": encoder.out.out_features},
            "dram": {"backbone": backbone, **sizes}, "session": {"bridge": 0.8} | (session or {})}


@dataclass
class DramBundle:
    config: dict
    tensors: dict
    audio: AudioEncoder
    net: Dram
    layout: Layout

    @property
    def idle(self):
        return self.tensors["idle.frames"].float()


def read(path):
    with safe_open(path, framework="pt") as f:
        settings = json.loads(f.metadata()[bundles.KEY])
        tensors = {k: f.get_tensor(k) for k in f.keys()}
    if settings.get("kind") != "dram" or settings["format"] != bundles.FORMAT:
        raise ValueError(f"{path} is of kind {settings.get('kind', 'sarah')}, format {settings['format']}; this code reads kind dram, format {bundles.FORMAT}")
    layers = [tuple(c[k] for k in ("inputs", "outputs", "kernel", "stride", "residual")) for c in settings["audio"]["layers"]]
    width, layout = settings["audio"]["features"], Layout(tuple(range(len(settings["rig"]["joints"]))))
    d = settings["dram"]
    net = Dram(layout.size, width, d["backbone"], {part: d[part] for part in ("monadic", "dyadic")})
    return DramBundle(settings, tensors, bundles.load_net("audio", AudioEncoder(layers, width), tensors), fill(net, tensors), layout)
