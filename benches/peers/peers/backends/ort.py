"""ONNX Runtime: f32, dynamic int8 (u8 activations, s8 weights a channel), 4-bit MatMulNBits (blocks of 32, int8 activations)."""
import os

import onnx
import onnxruntime as rt
from onnxruntime.quantization import QuantType, quantize_dynamic
from onnxruntime.quantization.matmul_nbits_quantizer import MatMulNBitsQuantizer
from onnxruntime.quantization.onnx_model import ONNXModel

VARIANTS = {
    "ort-f32": "all graph optimisations, one thread pool for both sessions, caches bound in place",
    "ort-i8": "quantize_dynamic: u8 activations, s8 weights per channel, constant MatMuls only; otherwise as f32",
    "ort-i4": "MatMulNBits: symmetric 4 bit, blocks of 32, accuracy level 4 (int8 activations); otherwise as f32",
}


def prepare(folder, variant):
    for name in ("flow", "decoder"):
        source, to = f"{folder}/{name}.onnx", f"{folder}/{name}.{variant}.onnx"
        if variant == "ort-f32" or os.path.exists(to):
            continue
        if variant == "ort-i8":
            quantize_dynamic(source, to, per_channel=True, weight_type=QuantType.QInt8, extra_options={"MatMulConstBOnly": True})
        else:
            model = ONNXModel(onnx.load(source))
            # Gemm is left f32 otherwise.
            model.replace_gemm_with_matmul()
            quantizer = MatMulNBitsQuantizer(model.model, block_size=32, is_symmetric=True, accuracy_level=4)
            quantizer.process()
            quantizer.model.save_model_to_file(to)


def open(folder, variant, threads, stream):
    rt.set_global_thread_pool_sizes(threads, 1)

    def session(name):
        options = rt.SessionOptions()
        options.graph_optimization_level = rt.GraphOptimizationLevel.ORT_ENABLE_ALL
        options.use_per_session_threads = False
        options.add_session_config_entry("session.set_denormal_as_zero", "1")
        path = f"{folder}/{name}.onnx" if variant == "ort-f32" else f"{folder}/{name}.{variant}.onnx"
        return rt.InferenceSession(path, options, providers=["CPUExecutionProvider"])

    def runner(session):
        names, outputs = [i.name for i in session.get_inputs()], [o.name for o in session.get_outputs()]
        fixed = {}

        def run(ring, *arrays):
            if id(ring) not in fixed:
                # Arrays of a stream stay where they are, so each ring is bound once.
                fixed[id(ring)] = [rt.OrtValue.ortvalue_from_numpy(a) for a in ring.inputs]
            binding = session.io_binding()
            for name, array in zip(names, arrays):
                binding.bind_cpu_input(name, array)
            for name, value in zip(names[len(arrays):], fixed[id(ring)]):
                binding.bind_ortvalue_input(name, value)
            for name in outputs:
                binding.bind_output(name)
            session.run_with_iobinding(binding)
            return binding.copy_outputs_to_cpu()
        return run

    flow, decoder = runner(session("flow")), runner(session("decoder"))
    return (lambda slot, z, cond, mod, cos, sin, bias, ring: flow(ring, z, cond, mod, cos, sin, bias),
            lambda z, cos, sin, bias, ring: decoder(ring, z, cos, sin, bias))
