// The scene of src/tests.rs, and its digest.

export const AGENT_RATE = 48000, USER_RATE = 16000;

/** Noise in bursts, of whole numbers. */
export function voice(seed, samples, rate) {
  let state = seed;
  return Float32Array.from({ length: samples }, (_, i) => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    const value = (state >>> 16) / 65536 - 0.5;
    return Math.floor((4 * i) / rate) % 3 === 2 ? 0 : 0.5 * value;
  });
}

/** Sample `n` of a head that walks to and fro, 72 a second. */
export function head(n) {
  const p = n % 576;
  const way = Math.min(p, 576 - p) / 144 - 1;
  return [way, 1.6, 1.5 + 0.25 * way];
}

/** Its rotation there. */
const turned = (n) => (n % 576 < 288 ? [0, 0.8, 0, 0.6] : [0.28, 0, 0, 0.96]);

/** Pushes all that a session of `blocks` blocks hears and sees; with `rotations` the head's own, with `sounds` one in the room that moves. */
export function fill(session, blocks, { rotations = false, sounds = false } = {}) {
  const seconds = Math.floor((blocks * 4) / 30) + 1;
  session.pushAgentVoice(voice(1, seconds * AGENT_RATE, AGENT_RATE), AGENT_RATE);
  session.pushUserVoice(voice(2, seconds * USER_RATE, USER_RATE), USER_RATE);
  if (sounds) [-2, 1].forEach((x) => session.pushSound(7, voice(3, USER_RATE, USER_RATE), USER_RATE, [x, 1, -1.5]));
  for (let n = 0; n < seconds * 72; n++) session.pushUserHead(...head(n), n / 72, rotations ? turned(n) : null);
}

const SAMPLERS = { single: 0, midpoint4: 4, midpoint2: 2, midpoint1: 1 };

/** FNV-1a of 32-bit words in two lanes. */
export class Digest {
  #lanes = [0x811c9dc5, 0x811c9dc5 ^ 0xffff];

  frames(frames) {
    for (const f of frames) {
      const sampler = SAMPLERS[f.sampler] ?? -Number(f.sampler.slice(6));
      for (const v of [f.index, f.time, f.root.x, f.root.z, f.root.yaw, ...f.hips, f.fitError, f.gaze ?? NaN, sampler, f.held]) {
        const words = new Uint32Array(Float64Array.of(v).buffer);
        this.#add(Number.isNaN(v) ? 0 : words[0]);
        this.#add(Number.isNaN(v) ? 0 : words[1]);
      }
    }
    const parts = [...frames.map((f) => f.joints), ...frames.map((f) => f.dyadic ?? new Float32Array())];
    for (const part of parts) new Uint32Array(part.slice().buffer).forEach((word) => this.#add(word));
  }

  #add(word) {
    const [a, b] = this.#lanes;
    this.#lanes = [Math.imul(a ^ word, 0x01000193), Math.imul(b ^ ((word << 16) | (word >>> 16)), 0x01000193)];
  }

  toString() {
    return this.#lanes.map((lane) => (lane >>> 0).toString(16).padStart(8, "0")).join("");
  }
}

/** The cases of digests.txt. */
export function cases(text) {
  return text.split("\n").filter((line) => line && !line.startsWith("#")).map((line) => {
    const [bundle, blocks, options, digest] = line.split(" ");
    return { bundle, blocks: Number(blocks), options: JSON.parse(options), digest };
  });
}

/** The digest of a case's motion, on `engine`. */
export async function motion(engine, { bundle, blocks, options }) {
  const session = engine.session({ ...options, clock: "manual" });
  const digest = new Digest();
  session.onFrames = (frames) => digest.frames(frames);
  fill(session, blocks, { rotations: bundle.includes("dram"), sounds: bundle.includes("hearing") });
  await session.advance((blocks * 4) / 30 - 0.01);
  session.close();
  return digest.toString();
}
