"""What the trainers share: their arguments, averages of weights, schedules, checkpoints, logs."""
import copy
import functools
import json
import math
import os

import torch


def arguments(parser, steps, lr, batch):
    """The options of every trainer."""
    parser.add_argument("--steps", type=int, default=steps, help=f"length of the schedule [{steps}]; the same seed and steps give the same model on one machine")
    parser.add_argument("--minutes", type=float, help="take as many steps as fit, by the time of the first ones, instead of --steps")
    parser.add_argument("--lr", type=float, default=lr, help=f"greatest learning rate [{lr}]")
    parser.add_argument("--batch", type=int, default=batch, help=f"windows of a step and process [{batch}]")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--threads", type=int, default=1, help="of each process, on a CPU")
    parser.add_argument("--workers", type=int, default=1, help="processes, each with batches of its own (CPU)")
    parser.add_argument("--compile", action="store_true", help="torch.compile the step: minutes at the start, then about 0.7 of a step's time on a CPU")
    parser.add_argument("--keep-minutes", type=float, default=4.0, help="time between checkpoints [4]; one is written, too, on SIGTERM and SIGINT")
    parser.add_argument("--resume", action="store_true", help="go on where the checkpoint --out stands")


def start_process(args):
    """Settings of the process; returns the device."""
    torch.set_num_threads(args.threads)
    torch.set_float32_matmul_precision("high")
    torch.manual_seed(getattr(args, "seed", 0))
    if args.device != "cpu" and args.workers > 1:
        raise SystemExit("--workers is for CPUs: one process drives a GPU")
    return torch.device(args.device)


@functools.cache
def multiplies_bf16():
    """Whether this CPU has instructions for products of bf16; oneDNN is 20 times slower with bf16 than with f32 where there are none."""
    try:
        with open("/proc/cpuinfo") as f:
            return not {"avx512_bf16", "amx_bf16", "bf16"}.isdisjoint(f.read().split())
    except OSError:
        return False


def mixed(device):
    """Matrix products in bf16, where they are fast."""
    kind = torch.device(device).type
    return torch.autocast(kind, torch.bfloat16, enabled=kind != "cpu" or multiplies_bf16())


class Ema:
    """Exponential moving average of weights; the rate rises from 0 so that early weights do not linger."""

    def __init__(self, net, rate=0.999):
        self.net, self.rate = copy.deepcopy(net).eval().requires_grad_(False), rate

    @torch.no_grad()
    def update(self, net, step):
        """`step`: updates so far, this one included."""
        rate = min(self.rate, (1 + step) / (10 + step))
        torch._foreach_lerp_(list(self.net.parameters()), list(net.parameters()), 1 - rate)


def rate(peak, step, progress, warmup=200, floor=0.02):
    """Linear warm-up over steps, then a cosine over `progress` 0 .. 1 down to `floor` of the peak."""
    return peak * min(1.0, (step + 1) / warmup) * (floor + (1 - floor) * 0.5 * (1 + math.cos(math.pi * progress)))


def optimiser(net, lr, decay=1e-2, fresh=1.0):
    """AdamW; matrices decay, vectors do not. `fresh`: factor on the rate of what embeds sounds."""
    groups = [{"params": [], "weight_decay": w, "scale": scale} for scale in (1.0, fresh) for w in (decay, 0.0)]
    for name, p in net.named_parameters():
        if p.requires_grad:
            groups[2 * ("_sound." in name) + (p.dim() <= 1)]["params"].append(p)
    every = [p for g in groups for p in g["params"]]
    return torch.optim.AdamW([g for g in groups if g["params"]], lr=lr, betas=(0.9, 0.99), fused=every[0].is_cuda)


def set_rate(optim, lr):
    for group in optim.param_groups:
        group["lr"] = lr * group.get("scale", 1.0)


def save(path, **state):
    """Checkpoint through a temporary name, so that an interruption leaves the last one whole."""
    torch.save(state, path + ".tmp")
    os.replace(path + ".tmp", path)


def load(path, **kw):
    """A checkpoint's tensors and plain values, on the CPU; nothing in a file is run."""
    return torch.load(path, weights_only=True, map_location="cpu", **kw)


def light(state):
    """A checkpoint as it travels: averaged weights in f16, no optimiser and no memory of the trainer."""
    half = lambda kept: {k: v.half() if v.is_floating_point() else v for k, v in kept.items()}
    beside = {name: {"ema": half(kept["ema"])} for name, kept in state.get("beside", {}).items()}
    return {k: v for k, v in state.items() if k not in ("net", "optim", "memory")} | {"ema": half(state["ema"]), "beside": beside}


def config(out, args):
    """Writes the arguments of a training to OUT.json; says which of them differ from those it began with."""
    path, given = out + ".json", {k: v for k, v in vars(args).items() if k != "resume"}
    if args.resume and os.path.exists(path):
        with open(path) as f:
            before = json.load(f)
        changed = {k: (before[k], v) for k, v in given.items() if k in before and before[k] != v and k not in ("keep_minutes", "threads")}
        if changed:
            print("resumed with other arguments: " + ", ".join(f"{k} {a} -> {b}" for k, (a, b) in changed.items()), flush=True)
    with open(path + ".tmp", "w") as f:
        json.dump(given, f, indent=1, sort_keys=True)
    os.replace(path + ".tmp", path)


class Log:
    """Prints a line and appends it as JSON to `path`, for `python -m visavis_train.train.curves`. `step`: what a resumed training starts
    from; lines after it are dropped, None starts the file anew."""

    def __init__(self, path, step=None):
        self.path, rows = path, []
        if step is not None and os.path.exists(path):
            with open(path) as f:
                rows = [line for line in f if json.loads(line)["step"] <= step]
        with open(path, "w") as f:
            f.writelines(rows)

    def write(self, **row):
        row = {k: round(v, 6) if isinstance(v, float) else v for k, v in row.items()}
        print(" ".join(f"{k} {v}" for k, v in row.items()), flush=True)
        with open(self.path, "a") as f:
            f.write(json.dumps(row) + "\n")
