"""Bundles of kind `mospa`: names, layouts and configuration as the runtime reads them."""
import json

from safetensors import safe_open

from .. import bundle as bundles
from ..motion import rig
from . import nets

STATS = ("motion_mean", "motion_std", "feature_mean", "feature_std")


def tensors_of(net):
    named = bundles.net_tensors("mospa", net)
    return {f"stats.{k}": named.pop(f"mospa.{k}") for k in STATS} | named


def config(sizes, *, name, description, licence):
    body = bundles.rig_config(rig.NAMES, rig.PARENTS, rig.OFFSETS, rig.EYES, rig.HEAD_BACK)
    return {"format": bundles.FORMAT, "kind": "mospa", "name": name, "description": description, "licence": licence, "rig": body, "mospa": sizes}


def read(path):
    """The network of a bundle in f32, and its configuration."""
    with safe_open(path, framework="pt") as f:
        settings = json.loads(f.metadata()[bundles.KEY])
        tensors = {k: f.get_tensor(k) for k in f.keys()}
    if settings.get("kind") != "mospa" or settings["format"] != bundles.FORMAT:
        raise ValueError(f"{path} is of kind {settings.get('kind', 'sarah')}, format {settings['format']}; this code reads kind mospa, format {bundles.FORMAT}")
    tensors |= {f"mospa.{k}": tensors[f"stats.{k}"] for k in STATS}
    return bundles.load_net("mospa", nets.Mospa(**settings["mospa"]), tensors), settings
