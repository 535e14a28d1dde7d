"""The two networks as ONNX, f32."""
import torch

from .nets import DecoderStep, FlowStep


def example(sizes):
    """Inputs of the right shapes: (flow's, decoder's), each (names, tensors)."""
    f, d, z = sizes["flow"], sizes["decoder"], torch.zeros
    p, q = f["window_blocks"] - 1, 5 * (d["window_blocks"] - 1)
    hd, dd = f["width"] // f["heads"], d["width"] // d["heads"]

    def past(layers, *shape):
        return [(f"past_{kind}{i}", z(*shape[:2], *(shape[:1:-1] if kind == "v" else shape[2:]))) for kind in "kv" for i in range(layers)]

    flow = [("z", z(2, sizes["latent"])), ("cond", z(2, 2, f["width"])), ("mod", z(6 * f["layers"] + 2, f["width"])), ("cos", z(2, 1, hd // 2)),
            ("sin", z(2, 1, hd // 2)), ("bias", z(2, p + 2)), *past(f["layers"], 2, f["heads"], hd, p)]
    dec = [("z", z(1, sizes["latent"])), ("cos", z(5, 1, dd // 2)), ("sin", z(5, 1, dd // 2)), ("bias", z(5, q + 5)),
           *past(d["layers"], 1, d["heads"], dd, q)]
    return flow, dec


OUTPUTS = (["x1", "k", "v"], ["frames", "k", "v"])


def steps(bundle):
    return FlowStep(bundle.flow).eval(), DecoderStep(bundle.vae.decoder).eval()


@torch.no_grad()
def onnx(bundle, sizes, folder):
    """Writes flow.onnx and decoder.onnx."""
    for name, net, inputs, outputs in zip(("flow", "decoder"), steps(bundle), example(sizes), OUTPUTS):
        torch.onnx.export(net, tuple(t for _, t in inputs), f"{folder}/{name}.onnx", input_names=[n for n, _ in inputs], output_names=outputs,
                          opset_version=17, dynamo=False)
