"""What was measured, as text, Markdown and JSON."""
import json
import os
import statistics

TITLES = {
    "visavis-f32": "Visavis f32", "visavis-i8": "**Visavis i8**", "visavis-i4": "**Visavis i4**", "ort-f32": "ONNX Runtime f32", "ort-i8": "ONNX Runtime int8 (dynamic)",
    "ort-i4": "ONNX Runtime 4-bit (MatMulNBits)", "openvino-f32": "OpenVINO f32", "openvino-i8": "OpenVINO int8 (weights by NNCF)", "openvino-static": "OpenVINO int8 (static by NNCF)", "openvino-i4": "OpenVINO int4 (NNCF)",
    "torch-f32": "PyTorch f32", "torch-i8": "PyTorch int8 (dynamic)", "tract-f32": "tract f32", "candle-f32": "candle f32", "candle-q8": "candle Q8_0", "candle-q4": "candle Q4_0",
    "ggml-q8": "ggml Q8_0", "ggml-q4": "ggml Q4_0 (repacked)",
}


def last(runs, threads):
    """Medians, best and memory by name, of the latest run with `threads` in which each took part."""
    out = {}
    for run in runs:
        if run["threads"] == threads:
            for name, peer in run["peers"].items():
                out[name] = {"median": statistics.median(peer["ms"]), "best": min(peer["ms"]), "blocks": len(peer["ms"]), "resident": peer["resident"], "peak": peer["peak"]}
    return out


def write(args):
    runs = json.load(open(f"{args.dir}/times.json"))
    checked = json.load(open(f"{args.dir}/check.json")) if os.path.exists(f"{args.dir}/check.json") else {}
    by = {threads: last(runs, threads) for threads in (1, 2)}
    names = sorted(set(by[1]) | set(by[2]), key=lambda n: by[2].get(n, by[1].get(n))["median"])
    rows = ["| | 1 thread, ms | 2 threads, ms | resident, MB | error of latents |", "|---|---|---|---|---|"]
    for name in names:
        cells = [f"{by[t][name]['median']:.1f}" if name in by[t] else "" for t in (1, 2)]
        resident = by[2].get(name, by[1].get(name))["resident"] / 1e6
        error = f"{checked[name]['first_block']:.1e}" if name in checked else ""
        rows.append(f"| {TITLES[name]} | {' | '.join(cells)} | {resident:.0f} | {error} |")
    ratios = {}
    for threads, all_ in by.items():
        peers = {n: p["median"] for n, p in all_.items() if not n.startswith("visavis")}
        if not peers:
            continue
        fastest = min(peers, key=peers.get)
        for name in ("visavis-i8", "visavis-i4"):
            if name in all_:
                ratios[f"{name}, {threads} threads"] = {"fastest": fastest, "ratio": peers[fastest] / all_[name]["median"]}
    lines = [f"{what}: {r['ratio']:.2f} x the speed of the fastest peer ({TITLES[r['fastest']]})" for what, r in ratios.items()]
    text = "\n".join(rows) + "\n\n" + "\n".join(lines) + "\n"
    print(text)
    with open(f"{args.dir}/table.json", "w") as f:
        json.dump({"threads": by, "ratios": ratios, "check": checked}, f, indent=1)
    if args.out:
        with open(args.out, "w") as f:
            f.write(text)
