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
  d.dyadic = d.dyadic === null ? null : bytes(d.dyadic);
  for (const name of ["agentVoice", "userVoice"]) d[name] = d[name] === null ? null : shorts(d[name]);
  d.index = new Map(d.joints.map((joint, j) => [joint.name, j]));
  d.duration = d.frames / d.fps;
  // Rest positions of the joints: offsets summed from the hips down.
  d.rest = [];
  for (const joint of d.joints) d.rest.push(joint.parent === null ? joint.offset : add(d.rest[joint.parent], joint.offset));
  d.speech = { agent: speechFrames(d.agentVoice, d), user: speechFrames(d.userVoice, d) };
  return d;
}

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
