"""Small signal helpers: smooth noise, minimum-jerk interpolation, critically damped followers. Frames at 30 fps."""
import numpy as np

FPS = 30


def smooth_noise(rng, t, period, amp=1.0):
    """Band-limited noise [t]: random knots every `period` seconds joined by cosine-smoothed cubic (Catmull-Rom) curves."""
    n = int(t / FPS / period) + 5
    k = rng.standard_normal(n)
    x = np.arange(t) / (FPS * period) + rng.random() + 1
    i = x.astype(int)
    f = x - i
    a, b, c, d = k[i - 1], k[i], k[i + 1], k[np.minimum(i + 2, n - 1)]
    return amp * 0.5 * (2 * b + (c - a) * f + (2 * a - 5 * b + 4 * c - d) * f ** 2 + (3 * b - a - 3 * c + d) * f ** 3)


def minjerk(u):
    """Minimum-jerk blend 0..1 (Flash & Hogan 1985)."""
    u = np.clip(u, 0, 1)
    return u ** 3 * (10 - 15 * u + 6 * u * u)


def keyed(t, times, values):
    """Piecewise minimum-jerk interpolation of keys (times [K] in frames ascending, values [K, ...]) at frames 0..t-1."""
    times = np.asarray(times, float)
    values = np.asarray(values, float)
    x = np.arange(t)
    i = np.clip(np.searchsorted(times, x, side="right") - 1, 0, len(times) - 1)
    j = np.minimum(i + 1, len(times) - 1)
    span = np.maximum(times[j] - times[i], 1e-6)
    u = np.where(j > i, minjerk((x - times[i]) / span), 0.0)
    u = u.reshape((-1,) + (1,) * (values.ndim - 1))
    return values[i] * (1 - u) + values[j] * u


def gaussian(x, sigma):
    """Gaussian smoothing along axis 0 with edge padding; kernel cut at 4 sigma."""
    r = int(np.ceil(4 * sigma))
    k = np.exp(-0.5 * (np.arange(-r, r + 1) / sigma) ** 2)
    k /= k.sum()
    x = np.asarray(x, float)
    flat = x.reshape(len(x), -1)
    pad = np.pad(flat, ((r, r), (0, 0)), mode="edge")
    out = np.stack([np.convolve(pad[:, c], k, "valid") for c in range(flat.shape[1])], 1)
    return out.reshape(x.shape)


def follow(target, omega, vmax=np.inf, amax=np.inf, x0=None):
    """Critically damped second-order follower of target [T] with speed and acceleration limits; omega [rad/s]."""
    dt = 1.0 / FPS
    x = float(target[0] if x0 is None else x0)
    v = 0.0
    out = np.empty(len(target))
    for i, g in enumerate(target.tolist()):
        a = omega * omega * (g - x) - 2 * omega * v
        a = amax if a > amax else -amax if a < -amax else a
        v += a * dt
        v = vmax if v > vmax else -vmax if v < -vmax else v
        x += v * dt
        out[i] = x
    return out


def delay(x, frames):
    """x delayed by whole frames along axis 0, the first value held."""
    if frames <= 0:
        return x
    return np.concatenate([np.repeat(x[:1], frames, 0), x[:-frames]])
