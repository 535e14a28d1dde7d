"""OpenVINO: f32, int8 weights and 4-bit weights by NNCF, activations quantised dynamically."""
import os

import openvino as ov

from ..plain import read
from ..stream import Stream

VARIANTS = {
    "openvino-f32": "latency hint, one stream, f32 inference precision, caches shared in place",
    "openvino-i8": "NNCF compress_weights INT8_SYM a channel, dynamic quantisation of activations in groups of 64, the fastest of 32, 64, 128 and rows; otherwise as f32",
    "openvino-static": "NNCF quantize (post-training, transformer preset, calibrated on 32 evaluations and 12 blocks): weights and activations int8; otherwise as f32",
    "openvino-i4": "NNCF compress_weights INT4_SYM in groups of 32, all layers, dynamic quantisation in groups of 32; otherwise as f32",
}


def prepare(folder, variant):
    import nncf
    for name in ("flow", "decoder"):
        to = f"{folder}/{name}.{variant}.xml"
        if os.path.exists(to):
            continue
        model = ov.convert_model(f"{folder}/{name}.onnx")
        if variant == "openvino-i8":
            model = nncf.compress_weights(model, mode=nncf.CompressWeightsMode.INT8_SYM)
        elif variant == "openvino-static":
            seen = samples(folder)[name]
            model = nncf.quantize(model, nncf.Dataset(seen), model_type=nncf.ModelType.TRANSFORMER, subset_size=len(seen))
        elif variant == "openvino-i4":
            model = nncf.compress_weights(model, mode=nncf.CompressWeightsMode.INT4_SYM, group_size=32, ratio=1.0, all_layers=True)
        ov.save_model(model, to, compress_to_fp16=False)


def samples(folder):
    """Inputs of evaluations and blocks, recorded from the f32 networks."""
    prepare(folder, "openvino-f32")
    sizes, data = read(f"{folder}/prepared.safetensors")
    stream, seen = Stream(sizes, data), {"flow": [], "decoder": []}
    nets = open(folder, "openvino-f32", 2, stream)

    def recording(name, run, first):
        def recorded(*arrays):
            seen[name].append([a.copy() for a in (*arrays[first:-1], *arrays[-1].inputs)])
            return run(*arrays)
        return recorded
    stream.run_with(recording("flow", nets[0], 1), recording("decoder", nets[1], 0))
    for number in range(sizes["blocks"]):
        stream.block(number)
    # Every third evaluation meets all eight flow times.
    return {"flow": seen["flow"][-stream.evaluations * sizes["blocks"]::3], "decoder": seen["decoder"][-sizes["blocks"]:]}


def open(folder, variant, threads, stream):
    core = ov.Core()
    config = {"PERFORMANCE_HINT": "LATENCY", "NUM_STREAMS": "1", "INFERENCE_NUM_THREADS": threads, "INFERENCE_PRECISION_HINT": "f32"}
    if variant in ("openvino-i8", "openvino-i4"):
        config["DYNAMIC_QUANTIZATION_GROUP_SIZE"] = "32" if variant == "openvino-i4" else "64"

    def runner(name, rings):
        model = core.compile_model(f"{folder}/{name}.{variant}.xml", "CPU", config)
        at = [p.get_any_name() for p in model.inputs]
        requests = {}
        for ring in rings:
            request = requests[id(ring)] = model.create_infer_request()
            tensors = [ov.Tensor(a, shared_memory=True) for a in ring.inputs]
            for name, tensor in zip([n for n in at if n.startswith("past_")], tensors):
                request.set_tensor(name, tensor)
        small = [n for n in at if not n.startswith("past_")]
        shared = {}

        def run(ring, *arrays):
            request = requests[id(ring)]
            for name, array in zip(small, arrays):
                key = (name, array.ctypes.data)
                if key not in shared:
                    shared[key] = (ov.Tensor(array, shared_memory=True), array)
                request.set_tensor(name, shared[key][0])
            request.infer()
            return [request.get_output_tensor(i).data for i in range(3)]
        return run

    flow, decoder = runner("flow", stream.rings), runner("decoder", [stream.ring])
    return (lambda slot, z, cond, mod, cos, sin, bias, ring: flow(ring, z, cond, mod, cos, sin, bias),
            lambda z, cos, sin, bias, ring: decoder(ring, z, cos, sin, bias))
