// The recording that is embedded in the page.

function bytes(text) {
  const raw = atob(text);
  const out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out;
}

// Tracks are little-endian; DataView keeps that on any machine.
function numbers(text, size, read, Type) {
  const view = new DataView(bytes(text).buffer);
  const out = new Type(Math.floor(view.byteLength / size));
  for (let i = 0; i < out.length; i++) out[i] = view[read](size * i, true);
  return out;
}
const floats = (text) => numbers(text, 4, "getFloat32", Float32Array);
const shorts = (text) => numbers(text, 2, "getInt16", Int16Array);

function loadRecording() {
  const d = JSON.parse(document.getElementById("recording").textContent);
  for (const name of ["root", "hips", "fit", "gaze", "user"]) d[name] = floats(d[name]);
  for (const name of ["local", "decoded"]) d[name] = shorts(d[name]);
  for (const name of ["sampler", "touch"]) d[name] = bytes(d[name]);
  for (const name of ["agentVoice", "userVoice", "heard"]) d[name] = d[name] === null ? null : shorts(d[name]);
  d.dyadic = d.dyadic === null ? null : sharesOf(bytes(d.dyadic), d.joints.length);
  d.index = new Map(d.joints.map((joint, j) => [joint.name, j]));
  d.duration = d.frames / d.fps;
  // Rest positions of the joints: offsets summed from the hips down.
  d.rest = [];
  for (const joint of d.joints) d.rest.push(joint.parent === null ? joint.offset : add(d.rest[joint.parent], joint.offset));
  d.speech = { agent: speechFrames(d.agentVoice, d), user: speechFrames(d.userVoice, d) };
  return d;
}

// How much each joint follows the user in each frame, 0 to 1; null for a frame that does not tell.
const sharesOf = (told, joints) => Array.from({ length: told.length / joints }, (_, i) =>
  told[i * joints] === 255 ? null : Float32Array.from(told.subarray(i * joints, (i + 1) * joints), (share) => share / 254));

// The frames about a time, as stage/pose.js takes them, and how far it is from the first to the second.
function framesAt(d, time) {
  const n = d.joints.length, exact = clamp(time * d.fps, 0, d.frames - 1), i = Math.floor(exact + 1e-6);
  const frame = (k) => ({
    root: [d.root[3 * k], d.root[3 * k + 1]],
    hips: d.hips.subarray(3 * k, 3 * k + 3),
    local: d.local.subarray(4 * n * k, 4 * n * (k + 1)),
    gaze: d.gaze[k],
    dyadic: d.dyadic?.[k] ?? null,
    user: Number.isNaN(d.user[3 * k]) ? null : [...d.user.subarray(3 * k, 3 * k + 3)],
  });
  return { i, from: frame(i), to: frame(Math.min(i + 1, d.frames - 1)), share: Math.max(0, exact - i) };
}

// Decoded joint positions of a frame, before the rig's bone lengths were imposed.
const decodedAt = (d, i) => d.joints.map((_, j) => [0, 1, 2].map((k) =>
  d.decoded[3 * (i * d.joints.length + j) + k] * d.step + (k === 0 ? d.root[3 * i] : k === 2 ? d.root[3 * i + 1] : 0)));

// Level of a voice in each frame, 0 to 1 of its own loud parts.
function speechFrames(voice, d) {
  if (!voice) return null;
  const per = d.audioRate / d.fps;
  const levels = new Float32Array(d.frames);
  for (let i = 0; i < d.frames; i++) {
    let sum = 0;
    for (let k = Math.floor(i * per); k < Math.min(voice.length, (i + 1) * per); k++) sum += voice[k] * voice[k];
    levels[i] = Math.sqrt(sum / per) / 32768;
  }
  const loud = Math.max(0.005, levels.slice().sort()[Math.floor(0.95 * d.frames)] || 0);
  return levels.map((l) => (l > 0.003 ? Math.min(1, l / loud) : 0));
}
