"""Block time against window, width, layers, guidance branches and sessions; one of them varies, the others stay as in BASE.

    benches/peers/run grow [--threads 2]        makes bundles, measures in two rounds, writes DIR/growth.json and docs/growth.svg
"""
import json
import os
import statistics
import subprocess

from safetensors import safe_open
from safetensors.numpy import save_file

from . import weights

BASE = {"window": 50, "width": 512, "layers": 4, "branches": 2, "sessions": 1}
CASES = {"window": [12, 25, 50, 100, 200], "width": [256, 512, 768, 1024], "layers": [2, 4, 6, 8], "branches": [2, 3], "sessions": [1, 2, 3, 4, 6]}
BLOCKS = 24


def ours(*args):
    return [os.environ["VISAVIS_PEERS_BIN"] + "/ours", *map(str, args)]


def bundle(folder, paper, case):
    """The int8 bundle of a case; windows share weights."""
    path = f"{folder}/grow-{case['width']}-{case['layers']}.safetensors"
    flow = dict(paper["flow"], width=case["width"], layers=case["layers"], tau_width=case["width"] // 2)
    if not os.path.exists(path):
        weights.write(f"{folder}/grow-f32.safetensors", dict(paper, flow=flow, student=None))
        subprocess.run(ours("quantize", f"{folder}/grow-f32.safetensors", path, "i8"), check=True)
        os.remove(f"{folder}/grow-f32.safetensors")
    windowed = f"{folder}/grow-{case['width']}-{case['layers']}-{case['window']}.safetensors"
    if not os.path.exists(windowed):
        with safe_open(path, framework="np") as f:
            config, tensors = json.loads(f.metadata()["visavis"]), {k: f.get_tensor(k) for k in f.keys()}
        config["flow"]["window_blocks"] = case["window"]
        save_file(tensors, windowed, metadata={"visavis": json.dumps(config)})
    return windowed


def cases():
    return [(what, value, BASE | {what: value}) for what, values in CASES.items() for value in values]


def prepare(args):
    paper = json.loads(subprocess.run(ours("config", "paper"), check=True, capture_output=True).stdout)
    return [(what, value, case, bundle(args.dir, paper, case)) for what, value, case in cases()]


def measure(args):
    threads = int(args.threads.split(",")[-1])
    times, ready = {}, prepare(args)
    for turn in range(2):
        for what, value, case, path in ready[::-1 if turn else 1]:
            command = ours("grow", path, threads, case["sessions"], int(case["branches"] == 3), case["window"] + 4, BLOCKS)
            ms = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)["ms"]
            times.setdefault(what, {}).setdefault(value, []).extend(ms)
    medians = {what: {v: statistics.median(times[what][v]) for v in values} for what, values in CASES.items()}
    with open(f"{args.dir}/growth.json", "w") as f:
        json.dump({"base": BASE, "threads": threads, "ms": medians}, f, indent=1)
    for what, by in medians.items():
        print(f"{what:9}", ", ".join(f"{v}: {ms:.2f} ms" for v, ms in by.items()), flush=True)
    here = os.path.dirname(os.path.abspath(__file__))
    with open(args.out or f"{here}/../../../docs/growth.svg", "w") as f:
        f.write(svg(medians, threads))


def svg(medians, threads):
    """A panel a quantity, all over one scale of milliseconds."""
    w, h, pad = 150, 180, 40
    top = max(ms for by in medians.values() for ms in by.values()) * 1.08
    step = next(s for s in (1, 2, 5, 10, 20, 50) if top / s <= 6)
    width = pad + len(medians) * (w + 24) + 10
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {h + 70}" font-family="sans-serif" font-size="11" fill="#333">',
           f'<rect width="{width}" height="{h + 70}" fill="#fff"/>', f'<text x="{pad}" y="16">ms a block; int8, 8 evaluations, {threads} threads; the rest at '
           + ", ".join(f"{k} {v}" for k, v in BASE.items()) + "</text>"]
    for n, (what, by) in enumerate(medians.items()):
        left, base = pad + n * (w + 24), h + 30
        right = max(by) * 1.08
        at = lambda v, ms: (left + w * v / right, base - h * ms / top)
        for k in range(int(top / step) + 1):
            y = base - h * k * step / top
            out.append(f'<line x1="{left}" y1="{y:.1f}" x2="{left + w}" y2="{y:.1f}" stroke="#ddd"/>')
            if n == 0:
                out.append(f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{k * step}</text>')
        points = [at(v, ms) for v, ms in by.items()]
        out.append('<polyline fill="none" stroke="#2a6fb0" stroke-width="1.5" points="' + " ".join(f"{x:.1f},{y:.1f}" for x, y in points) + '"/>')
        for (x, y), v in zip(points, by):
            out.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="#2a6fb0"/><text x="{x:.1f}" y="{base + 14}" text-anchor="middle">{v}</text>')
        out.append(f'<text x="{left + w / 2}" y="{base + 32}" text-anchor="middle" font-weight="bold">{what}</text>')
    return "\n".join(out) + "\n</svg>\n"
