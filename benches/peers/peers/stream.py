"""The streaming session around two networks with explicit caches: what a user of a peer would write. NumPy only, no copies of caches."""
import numpy as np

MASKED = np.float32(-1e9)


class Ring:
    """Keys [L, B, H, hd, P] and values [L, B, H, P, hd] of the last P tokens, in any order."""

    def __init__(self, layers, branches, heads, head_dim, past):
        self.past, self.swapped = past, False
        self.k = np.zeros((layers, branches, heads, head_dim, past), np.float32)
        self.v = np.zeros((layers, branches, heads, past, head_dim), np.float32)
        self.inputs = [*self.k, *self.v]

    def swap(self):
        """For a peer that wants keys [.., P, hd] and values [.., hd, P] in memory."""
        self.k, self.v = (np.ascontiguousarray(a.swapaxes(-1, -2)) for a in (self.k, self.v))
        self.inputs, self.swapped = [*self.k, *self.v], True

    def put(self, at, count, k, v):
        """New keys [L, B, H, hd, n] and values [L, B, H, n, hd] to places at .. at + n."""
        if self.swapped:
            self.k[..., at:at + count, :], self.v[..., at:at + count] = k.swapaxes(-1, -2), v.swapaxes(-1, -2)
        else:
            self.k[..., at:at + count], self.v[..., at:at + count, :] = k, v


class Phases:
    """Rotary cosines and sines of `rows` consecutive positions."""

    def __init__(self, rows, head_dim):
        half = head_dim // 2
        self.freq = 10000.0 ** (-np.arange(half, dtype=np.float64) / half)
        self.cos, self.sin = (np.zeros((rows, 1, half), np.float32) for _ in range(2))

    def at(self, first):
        angle = np.arange(first, first + len(self.cos))[:, None, None] * self.freq
        self.cos[:], self.sin[:] = np.cos(angle), np.sin(angle)


class Stream:
    """`flow(slot, z, cond, mod, cos, sin, bias, ring) -> x1, k, v` and `decoder(z, cos, sin, bias, ring) -> frames, k, v` run the networks.
    A runner may keep what it bound to a ring's memory: the arrays of a ring never change place."""

    def __init__(self, sizes, data):
        self.sizes, self.data = sizes, data
        f, d = sizes["flow"], sizes["decoder"]
        self.evaluations = 2 * sizes["steps"]
        self.past, self.dec_past = f["window_blocks"] - 1, 5 * (d["window_blocks"] - 1)
        self.rings = [Ring(f["layers"], 2, f["heads"], f["width"] // f["heads"], self.past) for _ in range(self.evaluations)]
        self.ring = Ring(d["layers"], 1, d["heads"], d["width"] // d["heads"], self.dec_past)
        self.phases, self.dec_phases = Phases(2, f["width"] // f["heads"]), Phases(5, d["width"] // d["heads"])
        self.bias = np.full((2, self.past + 2), MASKED, np.float32)
        self.dec_bias = np.full((5, self.dec_past + 5), MASKED, np.float32)
        self.z, self.cond = np.zeros((2, sizes["latent"]), np.float32), np.zeros((2, 2, f["width"]), np.float32)

    def run_with(self, flow, decoder):
        self.flow, self.decoder = flow, decoder
        self.reset()

    def reset(self):
        """The idle clip as history."""
        s, d = self.sizes, self.data
        self.token = 0
        self.done = None
        self.bias[:], self.dec_bias[:] = MASKED, MASKED
        self.dec_bias[:, self.dec_past:] = np.where(np.tri(5, dtype=bool), 0, MASKED)
        self.bias[0, self.past], self.bias[1, self.past:] = 0, 0
        for i in range(s["idle"]):
            z = d["idle"][i]
            if self.done is not None:
                self._evaluations(z, d["eps"][i], d["cond"][i], sample=False)
            self._finish(z, d["eps"][i], d["cond"][i])

    def _finish(self, z, eps, cond):
        self.done = (z, eps, cond)
        frames = self._decode(z * self.data["latent_std"] + self.data["latent_mean"])
        self.token += 1
        return frames

    def _decode(self, latent):
        self.dec_phases.at(5 * self.token)
        frames, k, v = self.decoder(latent[None].astype(np.float32), self.dec_phases.cos, self.dec_phases.sin, self.dec_bias, self.ring)
        at = 5 * self.token % self.dec_past
        self.ring.put(at, 5, k[:, None], v[:, None])
        self.dec_bias[:, at:at + 5] = 0
        return frames

    def _evaluations(self, start, eps, cond, sample=True):
        """The midpoint rule from `start`, its last step as two of Euler's; the finished token's keys and values enter the rings."""
        z_done, eps_done, cond_done = self.done
        n, g = self.evaluations, self.sizes["guidance"]
        position = self.token - 1  # of the finished token
        self.phases.at(position)
        # The new row sees one window back: the oldest token of a full ring is not in it.
        at = position % self.past
        self.bias[1, at] = MASKED
        self.cond[:, 0], self.cond[:, 1] = cond_done, cond
        z, step = start, 2.0 / n
        for i in range(n):
            tau = i / n
            self.z[0], self.z[1] = tau * z_done + (1 - tau) * eps_done, z
            x1, k, v = self.flow(i, self.z, self.cond, self.data["mod"][i], self.phases.cos, self.phases.sin, self.bias, self.rings[i])
            self.rings[i].put(at, 1, k[..., None], v[..., None, :])
            if sample:
                guided = x1[0] + np.float32(g) * (x1[1] - x1[0])
                if i == n - 1:  # ends at the last prediction
                    z = guided
                    break
                h = 0.5 * step if i % 2 == 0 else step
                z = start + np.float32(h / (1 - tau)) * (guided - z)
                start = start if i % 2 == 0 else z
        self.bias[:, at] = 0
        return z

    def block(self, number):
        """Block `number` of the prepared ones, or of a repetition of them: (latent, frames)."""
        s, d = self.sizes, self.data
        i = s["idle"] + number % s["blocks"]
        eps, cond = d["eps"][i], d["cond"][i]
        z = self._evaluations(eps, eps, cond)
        return z, self._finish(z, eps, cond)
