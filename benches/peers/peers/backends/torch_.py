"""PyTorch: f32 and dynamic int8, traced and frozen."""
import os

import torch

from visavis_train import bundle

from .. import export
from ..plain import read

VARIANTS = {
    "torch-f32": "inference mode, traced and frozen (TorchScript), denormals flushed",
    "torch-i8": "quantize_dynamic of all Linear layers (x86 engine), traced and frozen",
}


def prepare(folder, variant):
    names = ("flow", "decoder")
    if all(os.path.exists(f"{folder}/{n}.{variant}.pt") for n in names):
        return
    b = bundle.read(f"{folder}/f32.safetensors")
    sizes, _ = read(f"{folder}/prepared.safetensors")
    torch.backends.quantized.engine = "x86"
    for name, net, inputs in zip(names, export.steps(b), export.example(sizes)):
        if variant == "torch-i8":
            net = torch.ao.quantization.quantize_dynamic(net, {torch.nn.Linear}, dtype=torch.qint8)
        with torch.no_grad():
            torch.jit.freeze(torch.jit.trace(net, tuple(t for _, t in inputs), check_trace=False)).save(f"{folder}/{name}.{variant}.pt")


def open(folder, variant, threads, stream):
    torch.set_num_threads(threads)
    torch.set_flush_denormal(True)
    torch.backends.quantized.engine = "x86"

    def runner(name):
        net, seen = torch.jit.load(f"{folder}/{name}.{variant}.pt"), {}

        def run(ring, *arrays):
            if id(ring) not in seen:
                seen[id(ring)] = [torch.from_numpy(a) for a in ring.inputs]
            with torch.inference_mode():
                out = net(*(torch.from_numpy(a) for a in arrays), *seen[id(ring)])
            return [t.numpy() for t in out]
        return run

    flow, decoder = runner("flow"), runner("decoder")
    return (lambda slot, z, cond, mod, cos, sin, bias, ring: flow(ring, z, cond, mod, cos, sin, bias),
            lambda z, cos, sin, bias, ring: decoder(ring, z, cos, sin, bias))
