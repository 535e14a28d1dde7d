"""ggml through ggml-python, built for this machine's instructions: weights in Q8_0 or Q4_0, in the buffer type that repacks them where it does."""
import ctypes
import os
import sys

import ggml as g
import numpy as np
from safetensors.numpy import load_file, save_file

VARIANTS = {
    "ggml-q8": "Q8_0, multiplied by llamafile's kernels on x86 (ggml repacks none there), a graph a slot, allocated once; biases, norms and caches f32",
    "ggml-q4": "Q4_0 in the repacking buffer; otherwise as Q8_0",
}
TYPES = {"ggml-q8": g.GGML_TYPE_Q8_0, "ggml-q4": g.GGML_TYPE_Q4_0}


def matrices(folder):
    """Names and f32 values of the weight matrices of a pass, the latent's embedding folded in as in the other peers."""
    t = load_file(f"{folder}/f32.safetensors")
    embed = t["flow.embed_latent.weight"]
    t["flow.fold.weight"] = (t["flow.input.weight"][:, :len(embed)].astype(np.float64) @ embed).astype(np.float32)
    keep = [k for k in t if k.startswith(("flow.layers.", "flow.final.out", "flow.fold", "vae.decoder.")) and ".mod." not in k]
    return {k: np.ascontiguousarray(t[k], np.float32) for k in keep}


def prepare(folder, variant):
    to, kind, out = f"{folder}/{variant}.safetensors", TYPES[variant], {}
    if os.path.exists(to):
        return
    for name, value in matrices(folder).items():
        if name.endswith(".weight") and value.ndim == 2:
            rows, columns = value.shape
            packed = np.zeros(rows * g.ggml_row_size(kind, columns), np.uint8)
            g.ggml_quantize_chunk(kind, value.ctypes.data_as(ctypes.POINTER(ctypes.c_float)), packed.ctypes.data, 0, rows, columns, None)
            out[f"{name}:{rows}:{columns}"] = packed
        else:
            out[name] = value
    save_file(out, to)


def view(tensor, shape):
    """The memory of a host tensor as an array."""
    size = int(np.prod(shape))
    return np.ctypeslib.as_array((ctypes.c_float * size).from_address(tensor.contents.data)).reshape(shape)


class Context:
    """A ggml context for tensors whose data is elsewhere, and a few operations in it."""

    def __init__(self, tensors):
        size = tensors * g.ggml_tensor_overhead() + 2 * g.ggml_graph_overhead_custom(4096, False)
        self.c = g.ggml_init(g.ggml_init_params(mem_size=size, mem_buffer=None, no_alloc=True))

    def new(self, *ne, kind=g.GGML_TYPE_F32):
        return g.ggml_new_tensor(self.c, kind, len(ne), (ctypes.c_int64 * len(ne))(*ne))

    def over(self, array, *ne, kind=g.GGML_TYPE_F32):
        """A tensor over the memory of an array."""
        t = self.new(*ne, kind=kind)
        t.contents.data = array.ctypes.data
        return t


class Weights:
    """All weights; matrices that the repacking buffer has a kernel for lie there, the others, of the same type, in plain memory."""

    def __init__(self, path, kind):
        self.backend = g.ggml_backend_cpu_init()
        stored = [(*key.split(":"), value) for key, value in load_file(path).items()]
        matrices = [(name, int(rows), int(columns), value) for name, rows, columns, value in (s for s in stored if len(s) == 4)]
        extra, trial = self.extra(), Context(400)
        tensors = [trial.new(columns, rows, kind=kind) for _, rows, columns, _ in matrices]
        buffer = g.ggml_backend_alloc_ctx_tensors_from_buft(trial.c, extra) if extra else None
        fits = [bool(extra and t.contents.extra) for t in tensors]
        if buffer:
            g.ggml_backend_buffer_free(buffer)
        plain = Context(800)
        packed = Context(400)
        self.at = {name: (packed if fit else plain).new(columns, rows, kind=kind) for (name, rows, columns, _), fit in zip(matrices, fits)}
        self.buffers = [g.ggml_backend_alloc_ctx_tensors(plain.c, self.backend)] if not all(fits) else []
        self.buffers += [g.ggml_backend_alloc_ctx_tensors_from_buft(packed.c, extra)] if any(fits) else []
        for name, _, _, value in matrices:
            g.ggml_backend_tensor_set(self.at[name], value.ctypes.data, 0, value.nbytes)
        self.kept = [s[1] for s in stored if len(s) == 2]
        self.at |= {s[0]: plain.over(s[1], *s[1].shape[::-1]) for s in stored if len(s) == 2}
        self.contexts = packed, plain
        print(f"{sum(fits)} of {len(fits)} matrices repacked", file=sys.stderr)

    @staticmethod
    def extra():
        """The extra buffer type that is wanted (GGML_PEER_BUFFER, CPU_REPACK by default), if there is one."""
        device = g.ggml_backend_reg_dev_get(g.ggml_backend_cpu_reg(), 0)
        address = g.ggml_backend_reg_get_proc_address(g.ggml_backend_cpu_reg(), b"ggml_backend_dev_get_extra_bufts")
        types = ctypes.CFUNCTYPE(ctypes.POINTER(ctypes.c_void_p), ctypes.c_void_p)(address)(device) if address else [None]
        i = 0
        while types[i]:
            if g.ggml_backend_buft_name(types[i]).decode() == os.environ.get("GGML_PEER_BUFFER", "CPU_REPACK"):
                return types[i]
            i += 1
        return None


class Graph:
    """A graph of one network over one ring, allocated once."""

    def __init__(self, weights, stack, rows, branches, ring):
        self.w, self.stack, self.rows, self.branches = weights, stack, rows, branches
        self.x = Context(3000)
        self.c = self.x.c
        self.heads, self.hd = stack["heads"], stack["width"] // stack["heads"]
        self.past = ring.past
        self.ring = [self.x.over(k, self.hd, self.past, self.heads, branches) for k in ring.k], [self.x.over(v, self.past, self.hd, self.heads, branches) for v in ring.v]
        self.positions = np.zeros(rows * branches, np.int32)
        self.pos = self.x.over(self.positions, rows * branches, kind=g.GGML_TYPE_I32)
        self.mask = np.zeros((rows, self.past + rows), np.float32)
        self.bias = self.x.over(self.mask, self.past + rows, rows)
        self.outputs = []

    def linear(self, name, x, bias=True):
        y = g.ggml_mul_mat(self.c, self.w.at[f"{name}.weight"], x)
        return g.ggml_add(self.c, y, self.w.at[f"{name}.bias"]) if bias else y

    def norm(self, x, scale, shift):
        return g.ggml_add(self.c, g.ggml_mul(self.c, g.ggml_norm(self.c, x, 1e-5), scale), shift)

    def permuted(self, x):
        """[hd, H, rows branches] -> [hd, rows, H, branches], not contiguous."""
        return g.ggml_permute(self.c, g.ggml_reshape_4d(self.c, x, self.hd, self.heads, self.rows, self.branches), 0, 2, 1, 3)

    def attend(self, i, qkv):
        c, hd, h, n, d = self.c, self.hd, self.heads, self.rows * self.branches, self.stack["width"]
        part = lambda p: g.ggml_view_3d(c, qkv, hd, h, n, 4 * hd, 12 * d, 4 * p * d)
        turned = lambda t: g.ggml_rope_ext(c, t, self.pos, None, hd, g.GGML_ROPE_TYPE_NEOX, 0, 10000.0, 1.0, 0.0, 1.0, 32.0, 1.0)
        k, v = turned(part(1)), g.ggml_cont(c, part(2))
        for t in (k, v):
            g.ggml_set_output(t)
            g.ggml_build_forward_expand(self.graph, t)
        self.outputs += [k, v]
        q, k, v = self.permuted(turned(part(0))), self.permuted(k), g.ggml_cont(c, g.ggml_transpose(c, self.permuted(v)))
        keys, values = self.ring[0][i], self.ring[1][i]
        scores = g.ggml_concat(c, g.ggml_mul_mat(c, keys, q), g.ggml_mul_mat(c, k, q), 0)
        w = g.ggml_soft_max_ext(c, scores, self.bias, 1.0 / hd**0.5, 0.0)
        nb = w.contents.nb
        piece = lambda length, at: g.ggml_view_4d(c, w, length, self.rows, h, self.branches, nb[1], nb[2], nb[3], 4 * at)
        y = g.ggml_add(c, g.ggml_mul_mat(c, values, piece(self.past, 0)), g.ggml_mul_mat(c, v, piece(self.rows, self.past)))
        return g.ggml_reshape_2d(c, g.ggml_cont(c, g.ggml_permute(c, y, 0, 2, 1, 3)), d, n)

    def begin(self):
        self.graph = g.ggml_new_graph_custom(self.c, 4096, False)

    def end(self, out):
        g.ggml_set_output(out)
        g.ggml_build_forward_expand(self.graph, out)
        self.allocator = g.ggml_gallocr_new(g.ggml_backend_get_default_buffer_type(self.w.backend))
        if not g.ggml_gallocr_alloc_graph(self.allocator, self.graph):
            raise RuntimeError("ggml could not allocate the graph")
        self.out = view(out, (out.contents.ne[1], out.contents.ne[0]))
        shape = (self.branches, self.rows, self.heads, self.hd)
        self.rows_of = [view(t, shape) for t in self.outputs]

    def compute(self):
        if g.ggml_backend_graph_compute(self.w.backend, self.graph) != 0:
            raise RuntimeError("ggml did not compute the graph")
        return self.out, self.rows_of[0::2], self.rows_of[1::2]


def flow_graph(weights, stack, latent, ring, modulation):
    x = Graph(weights, stack, 2, 2, ring)
    c, d = x.c, stack["width"]
    x.begin()
    x.z, x.cond = np.zeros((2, latent), np.float32), np.zeros((2, 2, d), np.float32)
    mods = [x.x.over(row, d) for row in modulation]
    y = g.ggml_add(c, x.x.over(x.cond, d, 2, 2), x.linear("flow.fold", x.x.over(x.z, latent, 2), bias=False))
    y = g.ggml_reshape_2d(c, y, d, 4)
    for i in range(stack["layers"]):
        m, name = mods[6 * i:6 * i + 6], f"flow.layers.{i}"
        a = x.attend(i, x.linear(f"{name}.qkv", x.norm(y, m[1], m[0])))
        y = g.ggml_add(c, y, g.ggml_mul(c, x.linear(f"{name}.proj", a), m[2]))
        f = x.linear(f"{name}.fc2", g.ggml_gelu(c, x.linear(f"{name}.fc1", x.norm(y, m[4], m[3]))))
        y = g.ggml_add(c, y, g.ggml_mul(c, f, m[5]))
    m = mods[6 * stack["layers"]:]
    new = g.ggml_cont(c, g.ggml_view_2d(c, y, d, 2, 8 * d, 4 * d))
    x.end(x.linear("flow.final.out", x.norm(new, m[1], m[0])))
    return x


def decoder_graph(weights, stack, latent, ring):
    x = Graph(weights, stack, 5, 1, ring)
    c, d = x.c, stack["width"]
    x.begin()
    at = weights.at
    affine = lambda name: (at[f"{name}.weight"], at[f"{name}.bias"])
    x.z = np.zeros((1, latent), np.float32)
    slot = at["vae.decoder.slot"]
    first = g.ggml_add(c, x.linear("vae.decoder.latent", x.x.over(x.z, latent, 1)), g.ggml_view_2d(c, slot, d, 1, 4 * d, 0))
    rest = g.ggml_add(c, at["vae.decoder.frame_token"], g.ggml_view_2d(c, slot, d, 4, 4 * d, 4 * d))
    y = g.ggml_concat(c, first, rest, 1)
    for i in range(stack["layers"]):
        name = f"vae.decoder.layers.{i}"
        y = g.ggml_add(c, y, x.linear(f"{name}.proj", x.attend(i, x.linear(f"{name}.qkv", x.norm(y, *affine(f"{name}.ln1"))))))
        y = g.ggml_add(c, y, x.linear(f"{name}.fc2", g.ggml_gelu(c, x.linear(f"{name}.fc1", x.norm(y, *affine(f"{name}.ln2"))))))
    frames = g.ggml_cont(c, g.ggml_view_2d(c, x.norm(y, *affine("vae.decoder.ln_f")), d, 4, 4 * d, 4 * d))
    x.end(x.linear("vae.decoder.out", frames))
    return x


def open(folder, variant, threads, stream):
    # ggml multiplies along rows of both: keys lie token by token, values channel by channel.
    for ring in [*stream.rings, stream.ring]:
        ring.swap()
    sizes = stream.sizes
    weights = Weights(f"{folder}/{variant}.safetensors", TYPES[variant])
    g.ggml_backend_cpu_set_n_threads(weights.backend, threads)
    flows = [flow_graph(weights, sizes["flow"], sizes["latent"], r, m) for r, m in zip(stream.rings, stream.data["mod"])]
    dec = decoder_graph(weights, sizes["decoder"], sizes["latent"], stream.ring)

    def flow(slot, z, cond, mod, cos, sin, bias, ring):
        x = flows[slot]
        x.z[:], x.cond[:], x.mask[:] = z, cond, bias
        x.positions[:] = [stream.token - 1, stream.token] * 2
        out, k, v = x.compute()
        return out, np.stack([t[:, 0] for t in k]), np.stack([t[:, 0] for t in v])

    def decoder(z, cos, sin, bias, ring):
        dec.z[:], dec.mask[:] = z, bias
        dec.positions[:] = 5 * stream.token + np.arange(5)
        out, k, v = dec.compute()
        return out, np.stack([t[0].transpose(1, 2, 0) for t in k]), np.stack([t[0].transpose(1, 0, 2) for t in v])

    return flow, decoder
