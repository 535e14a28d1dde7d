// Sounds in the room: made here, put on the floor by the user, heard by the agent from their place and by the user from theirs.
//
// A sound begins with the session's next block, and is heard by the user when the frames of that moment are shown. Samples are pascals
// as they are 1 m from the source.
import { BLOCK } from "./agent.js";

const RATE = 24000;
// Full scale of the speakers, pascals at a metre: louder is flattened.
const LOUDEST = 4;
const FARTHEST = 8;

// Made by rule, the same each time: [seconds, height above the floor (m), level (RMS while it is loudest, Pa), sample at t (s)].
const KINDS = {
  bang: [1.4, 0.4, 2.5, (t, noise) => noise() * Math.exp(-9 * t) + 0.7 * Math.sin(2 * Math.PI * 58 * t) * Math.exp(-6 * t)],
  phone: [4.2, 0.8, 0.09, (t) => {
    // Two bells, struck in turn, a second on and most of one off.
    const ring = t % 1.6, strike = ring % 0.05;
    return ring > 1 ? 0 : (Math.sin(2 * Math.PI * 1180 * t) + 0.6 * Math.sin(2 * Math.PI * 1480 * t)) * Math.exp(-14 * strike) * Math.min(1, ring * 60);
  }],
  knock: [1.1, 1.1, 0.5, (t, noise) => {
    const since = t % 0.3;
    return t > 0.9 ? 0 : (0.5 * noise() + Math.sin(2 * Math.PI * 170 * since)) * Math.exp(-38 * since);
  }],
  bark: [1.7, 0.45, 0.8, (t, noise) => {
    // Two short ones and a pause, a throat that opens and closes.
    const since = [0, 0.34, 1.1].map((start) => t - start).findLast((s) => s >= 0), open = Math.sin(Math.PI * Math.min(1, since / 0.2));
    const pitch = 2 * Math.PI * (430 * since + 500 * since * (0.2 - since));
    return since > 0.2 ? 0 : open * (Math.sin(pitch) + 0.6 * Math.sin(2 * pitch) + 0.4 * Math.sin(3 * pitch) + 0.5 * noise());
  }],
  music: [9.6, 0.9, 0.12, (t) => {
    // Plucked notes of a pentatonic scale over a bass, 100 beats a minute.
    const note = (number, since, fall) => Math.sin(2 * Math.PI * 220 * 2 ** (number / 12) * since) * Math.exp(-fall * since) * Math.min(1, since * 300);
    const TUNE = [12, 15, 19, 22, 24, 22, 19, 15, 10, 15, 17, 22, 24, 27, 22, 19], BASS = [0, 0, -2, -5], step = 0.3, fade = Math.min(1, (9.6 - t) / 0.8);
    const i = Math.floor(t / step), melody = note(TUNE[i % 16], t % step, 6) + 0.5 * note(TUNE[(i + 15) % 16], (t % step) + step, 6);
    return fade * (melody + 0.9 * note(BASS[Math.floor(i / 4) % 4] - 12, t % (2 * step), 3));
  }],
};
export const SOUNDS = Object.keys(KINDS);

const made = new Map();
function sound(name) {
  if (made.has(name)) return made.get(name);
  const [seconds, , level, at] = KINDS[name];
  let state = 1;
  const noise = () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 31 - 1;
  const samples = Float32Array.from({ length: Math.round(seconds * RATE) }, (_, i) => at(i / RATE, noise));
  // The loudest 50 ms get the level.
  let loudest = 0;
  for (let from = 0, n = RATE / 20; from < samples.length; from += n) {
    let sum = 0;
    for (let i = from; i < Math.min(samples.length, from + n); i++) sum += samples[i] * samples[i];
    loudest = Math.max(loudest, Math.sqrt(sum / n));
  }
  made.set(name, samples.map((x) => (x * level) / loudest));
  return made.get(name);
}

export function createSounds(agent, user, openContext) {
  let sources = [], next = 1, out = null, context = null;
  const sounds = {};
  const endOf = ({ start, samples, rate }) => start + samples.length / rate;

  // Puts a sound of this page, or samples in pascals, at a place in the world; `height` as its kind has it where the place lies on the floor.
  sounds.drop = async (what, [x, y, z], rate = RATE) => {
    const [name, samples] = typeof what === "string" ? [what, sound(what)] : ["a sound", what];
    const at = [x, y ?? KINDS[name]?.[1] ?? 1, z];
    const source = { id: next++, name, samples, rate, at, start: BLOCK * Math.ceil(agent.now() / BLOCK), player: null };
    agent.session.pushSound(source.id, samples, rate, at);
    sources.push(source);
    context = openContext();
    await context?.resume().catch(() => {});
    if (context && sources.includes(source)) play(source);
    return source;
  };

  function play(source) {
    if (!out) {
      // What would be too loud for speakers is pressed together.
      out = context.createDynamicsCompressor();
      out.connect(context.destination);
    }
    const buffer = context.createBuffer(1, source.samples.length, source.rate), panner = context.createPanner();
    buffer.getChannelData(0).set(source.samples.map((p) => Math.max(-1, Math.min(1, p / LOUDEST))));
    Object.assign(panner, { panningModel: "HRTF", distanceModel: "inverse", refDistance: 1, rolloffFactor: 1 });
    place(panner, "position", source.at);
    source.player = context.createBufferSource();
    source.player.buffer = buffer;
    const gain = context.createGain();
    // Quiet ones are heard as if the room were quieter than most are.
    gain.gain.value = 2;
    source.player.connect(gain).connect(panner).connect(out);
    const wait = source.start - agent.shown() - (context.outputLatency || context.baseLatency || 0);
    source.player.start(context.currentTime + Math.max(0, wait), Math.max(0, -wait));
  }

  function place(node, name, [x, y, z]) {
    for (const [axis, value] of [["X", x], ["Y", y], ["Z", z]]) if (node[name + axis]) node[name + axis].value = value;
  }

  // The user's ears, as often as a picture is drawn.
  sounds.listen = () => {
    sources = sources.filter((source) => agent.shown() < endOf(source) + 1);
    if (!context || !sources.length) return;
    const [x, y, z, w] = user.rotation, { listener } = context;
    place(listener, "position", user.position);
    place(listener, "forward", [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]);
    place(listener, "up", [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)]);
  };

  // All end at once.
  sounds.clear = () => {
    for (const { id, player } of sources) {
      player?.stop();
      if (agent.facts.hasHearing) agent.session.endSound(id);
    }
    sources = [];
  };

  // As the stage draws them.
  sounds.shown = () => sources.filter((source) => agent.shown() >= source.start - BLOCK)
    .map((source) => ({ name: source.name, at: source.at, on: agent.shown() >= source.start && agent.shown() < endOf(source), age: Math.max(0, agent.shown() - source.start) }));
  sounds.sounding = () => sounds.shown().filter(({ on }) => on).map(({ name }) => name);
  return sounds;
}

// Where on the floor a point of the canvas (-1 to 1, right and up) lies, within sight; null above the horizon.
export function floorAt(view, x, y, middle) {
  const { camera: c, projection: p, eye } = view;
  const [right, up] = [(x + p[8]) / p[0], (y + p[9]) / p[5]];
  const way = [0, 1, 2].map((k) => right * c[4 * k] + up * c[4 * k + 1] - c[4 * k + 2]);
  if (way[1] > -0.02) return null;
  const far = -eye[1] / way[1], [px, pz] = [eye[0] + far * way[0], eye[2] + far * way[2]];
  // Far off it is brought in, so that it can be heard.
  const away = Math.hypot(px - middle[0], pz - middle[1]), share = Math.min(1, FARTHEST / away);
  return [middle[0] + share * (px - middle[0]), undefined, middle[1] + share * (pz - middle[1])];
}
