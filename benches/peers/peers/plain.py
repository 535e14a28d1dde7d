"""Reading prepared data without PyTorch."""
import json

from safetensors import safe_open


def read(path):
    """(sizes, tensors)."""
    with safe_open(path, framework="np") as f:
        return json.loads(f.metadata()["sizes"]), {k: f.get_tensor(k) for k in f.keys()}
