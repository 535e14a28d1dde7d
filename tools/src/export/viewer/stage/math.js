// Vectors are arrays of three, quaternions [x, y, z, w], matrices column-major arrays of sixteen. Metres, Y up.

const clamp = (x, low, high) => Math.min(high, Math.max(low, x));
const mix = (a, b, t) => a + (b - a) * t;
const smoothstep = (low, high, x) => { const t = clamp((x - low) / (high - low), 0, 1); return t * t * (3 - 2 * t); };

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const lerp = (a, b, t) => [mix(a[0], b[0], t), mix(a[1], b[1], t), mix(a[2], b[2], t)];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const length = (a) => Math.hypot(a[0], a[1], a[2]);
const unit = (a) => { const l = length(a); return l > 1e-9 ? scale(a, 1 / l) : [0, 0, 1]; };

// v turned by the quaternion at q[at..at + 4].
function rotate(q, v, at = 0) {
  const x = q[at], y = q[at + 1], z = q[at + 2], w = q[at + 3];
  const tx = 2 * (y * v[2] - z * v[1]), ty = 2 * (z * v[0] - x * v[2]), tz = 2 * (x * v[1] - y * v[0]);
  return [v[0] + w * tx + y * tz - z * ty, v[1] + w * ty + z * tx - x * tz, v[2] + w * tz + x * ty - y * tx];
}

// The rotation that turns +Z to `forward` with +Y up.
function lookRotation(forward) {
  const yaw = Math.atan2(forward[0], forward[2]);
  const pitch = -Math.atan2(forward[1], Math.hypot(forward[0], forward[2]));
  const [sy, cy, sp, cp] = [Math.sin(yaw / 2), Math.cos(yaw / 2), Math.sin(pitch / 2), Math.cos(pitch / 2)];
  return [cy * sp, sy * cp, -sy * sp, cy * cp];
}

function perspective(fovY, aspect, near, far) {
  const f = 1 / Math.tan(fovY / 2), n = 1 / (near - far);
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) * n, -1, 0, 0, 2 * far * near * n, 0];
}

function lookAt(eye, target) {
  const z = unit(sub(eye, target));
  const x = unit(cross([0, 1, 0], z));
  const y = cross(z, x);
  return [x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1];
}

function multiply(a, b) {
  const out = new Array(16);
  for (let c = 0; c < 4; c++) {
    for (let r = 0; r < 4; r++) {
      out[4 * c + r] = a[r] * b[4 * c] + a[4 + r] * b[4 * c + 1] + a[8 + r] * b[4 * c + 2] + a[12 + r] * b[4 * c + 3];
    }
  }
  return out;
}

// Clip coordinates [x, y, z, w] of a point.
function project(m, p) {
  const row = (r) => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r];
  return [row(0), row(1), row(2), row(3)];
}

// Colour of a gaze score: coral for away, amber for aside, green for eye contact; 0..1 each.
function gazeColour(score) {
  const stops = [[0.95, 0.42, 0.36], [0.96, 0.72, 0.32], [0.22, 0.78, 0.62]];
  const t = clamp(score, 0, 1) * 2;
  return t < 1 ? lerp(stops[0], stops[1], t) : lerp(stops[1], stops[2], t - 1);
}

// Colour of a moment of the recording, 0 to 1: blue over violet to rose.
function timeColour(t) {
  const stops = [[0.29, 0.56, 0.98], [0.60, 0.45, 0.96], [0.96, 0.44, 0.66]];
  const x = clamp(t, 0, 1) * 2;
  return x < 1 ? lerp(stops[0], stops[1], x) : lerp(stops[1], stops[2], x - 1);
}

// Colour of how much a joint follows the user, 0 to 1: blue for the agent's own, rose for the user's.
function dyadicColour(share) {
  return lerp([0.29, 0.56, 0.98], [0.96, 0.36, 0.60], clamp(share, 0, 1));
}

// Colour of sounds in the room.
const SOUND = [1, 0.62, 0.16];

// How strongly that colour covers clothes, and skin.
const WHOM = { body: 0.85, skin: 0.45 };

const css = (c, alpha = 1) => `rgba(${c.map((x) => Math.round(255 * clamp(x, 0, 1))).join(",")},${alpha})`;
