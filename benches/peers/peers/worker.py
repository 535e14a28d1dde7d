"""A worker: one peer in a process of its own, answering one line of JSON with another (the protocol of rust/src/worker.rs).

    python -m peers.worker FOLDER VARIANT THREADS
"""
import json
import os
import sys
import time


def backend(variant):
    """The module that has it. Imported late: a worker holds one framework only."""
    from importlib import import_module
    family = variant.split("-")[0]
    return import_module({"ort": "peers.backends.ort", "openvino": "peers.backends.openvino_", "torch": "peers.backends.torch_", "ggml": "peers.backends.ggml_"}[family])


def memory(key):
    with open("/proc/self/status") as f:
        return next(1024 * int(line.split()[1]) for line in f if line.startswith(key))


def main():
    folder, variant, threads = sys.argv[1], sys.argv[2], int(sys.argv[3])
    from .plain import read
    from .stream import Stream
    import numpy as np
    from safetensors.numpy import save_file

    sizes, data = read(f"{folder}/prepared.safetensors")
    stream = Stream(sizes, data)
    stream.run_with(*backend(variant).open(folder, variant, threads, stream))
    number = 0
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # frameworks print to stdout

    def answer(**what):
        print(json.dumps(what), file=answers, flush=True)

    answer(ready=True, peak=memory("VmHWM:"))
    for line in sys.stdin:
        request = json.loads(line)
        if "time" in request:
            times = []
            for _ in range(request["time"]):
                started = time.perf_counter()
                stream.block(number)
                times.append(1000 * (time.perf_counter() - started))
                number += 1
            answer(ms=times, peak=memory("VmHWM:"), resident=memory("VmRSS:"))
        else:
            stream.reset()
            out = [[np.array(a, copy=True) for a in stream.block(k)] for k in range(sizes["blocks"])]
            save_file({"latents": np.concatenate([z.reshape(-1) for z, _ in out]).astype(np.float32), "decoded": np.concatenate([f.reshape(-1) for _, f in out])}, request["check"])
            answer(written=request["check"])


if __name__ == "__main__":
    main()
