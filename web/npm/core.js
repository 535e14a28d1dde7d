// The module's interface (web/src), call by call. Memory views are made anew after each call, since memory may have grown.

import { VisavisError } from "./errors.js";

const encoder = new TextEncoder(), decoder = new TextDecoder();

export const FRAME_NUMBERS = 12;
export const JOINT_NUMBERS = 11;
const BLOCK_FRAMES = 4;

export class Core {
  #exports;
  /** Set by a trap: nothing of the instance may be called any more. */
  fault = null;

  static async instantiate(module) {
    const core = new Core();
    const instance = await WebAssembly.instantiate(module, { env: { visavis_now_ms: () => performance.now() } });
    core.#exports = instance.exports;
    return core;
  }

  /** Loads a bundle. */
  engine(bytes) {
    const pointer = this.withBytes(bytes, (at) => this.made("visavis_engine_new", at, bytes.byteLength));
    this.call("visavis_engine_facts", pointer);
    return new EngineCore(this, pointer, JSON.parse(this.text()));
  }

  /** Bytes of the module's memory. */
  get memoryBytes() {
    return this.#exports.memory.buffer.byteLength;
  }

  call(name, ...values) {
    if (this.fault) throw this.fault;
    try {
      return this.#exports[name](...values);
    } catch (error) {
      throw this.#trapped(error);
    }
  }

  /** As `call`, of a function whose result is a status. */
  do(name, ...values) {
    const status = this.call(name, ...values);
    if (status !== 0) throw VisavisError.ofStatus(status, this.text());
  }

  /** As `call`, of a function that makes something and takes a pointer to a status last. */
  made(name, ...values) {
    return this.withBytes(new Uint8Array(4), (at) => {
      const pointer = this.call(name, ...values, at);
      if (pointer === 0) throw VisavisError.ofStatus(new Int32Array(this.buffer, at, 1)[0], this.text());
      return pointer;
    });
  }

  /** Runs `body` with the address of a copy of `bytes`. */
  withBytes(bytes, body) {
    const at = this.call("visavis_alloc", bytes.byteLength);
    new Uint8Array(this.buffer, at, bytes.byteLength).set(new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength));
    try {
      return body(at);
    } finally {
      if (!this.fault) this.call("visavis_free", at, bytes.byteLength);
    }
  }

  get buffer() {
    return this.#exports.memory.buffer;
  }

  text() {
    const bytes = new Uint8Array(this.buffer, this.#exports.visavis_text(), this.#exports.visavis_text_length());
    return decoder.decode(bytes);
  }

  #trapped(error) {
    let text = error.message;
    try {
      text = this.text() || text;
    } catch { /* The instance is past asking. */ }
    this.fault = new VisavisError("fault", `the runtime stopped (${text}): load the engine again, and please report this text`, { cause: error });
    return this.fault;
  }
}

class EngineCore {
  constructor(core, pointer, facts) {
    Object.assign(this, { core, pointer, facts });
  }

  session(options) {
    const json = encoder.encode(JSON.stringify(options));
    const pointer = this.core.withBytes(json, (at) => this.core.made("visavis_session_new", this.pointer, at, json.byteLength));
    return new SessionCore(this.core, pointer, this.facts.joints.length);
  }

  close() {
    this.core.call("visavis_engine_free", this.pointer);
  }
}

/** Voices: 0 the agent's, 1 the user's. */
class SessionCore {
  constructor(core, pointer, joints) {
    Object.assign(this, { core, pointer, joints });
  }

  pushVoice(voice, samples, rate) {
    this.core.withBytes(samples, (at) => this.core.do("visavis_push_voice", this.pointer, voice, at, samples.length, rate));
  }

  finishVoice(voice) {
    this.core.do("visavis_finish_voice", this.pointer, voice);
  }

  clearVoice(voice) {
    this.core.do("visavis_clear_voice", this.pointer, voice);
  }

  setVoicePresent(voice, present) {
    this.core.do("visavis_set_voice_present", this.pointer, voice, present ? 1 : 0);
  }

  pushHead(x, y, z, time) {
    this.core.do("visavis_push_head", this.pointer, x, y, z, time);
  }

  pushPose(x, y, z, [qx, qy, qz, qw], time) {
    this.core.do("visavis_push_pose", this.pointer, x, y, z, qx, qy, qz, qw, time);
  }

  pushSound(id, samples, rate, [x, y, z]) {
    this.core.withBytes(samples, (at) => this.core.do("visavis_push_sound", this.pointer, id, at, samples.length, rate, x, y, z));
  }

  endSound(id) {
    this.core.do("visavis_end_sound", this.pointer, id);
  }

  pushEars(left, right, rate) {
    const both = new Float32Array(2 * left.length);
    both.set(left);
    both.set(right, left.length);
    this.core.withBytes(both, (at) => this.core.do("visavis_push_ears", this.pointer, at, left.length, rate));
  }

  endEars() {
    this.core.do("visavis_end_ears", this.pointer);
  }

  /** [x, y, z], or null. */
  heardPlace() {
    return this.core.withBytes(new Uint8Array(12), (at) => (this.core.call("visavis_heard_place", this.pointer, at) ? [...new Float32Array(this.core.buffer, at, 3)] : null));
  }

  setSensitivity(sensitivity) {
    this.core.do("visavis_set_sensitivity", this.pointer, sensitivity);
  }

  setGaze(target) {
    this.core.do("visavis_set_gaze", this.pointer, target ?? NaN);
  }

  setSampler(name) {
    const bytes = encoder.encode(name);
    this.core.withBytes(bytes, (at) => this.core.do("visavis_set_sampler", this.pointer, at, bytes.length));
  }

  setBudget(milliseconds) {
    this.core.do("visavis_set_budget", this.pointer, milliseconds);
  }

  /** Steps down to `engine`, of this instance, instead of holding a pose. */
  setFallback(engine) {
    this.core.do("visavis_set_fallback", this.pointer, engine.pointer);
  }

  reportBlockTime(milliseconds) {
    this.core.do("visavis_report_block_time", this.pointer, milliseconds);
  }

  reset() {
    this.core.do("visavis_reset", this.pointer);
  }

  get nextDue() {
    return this.core.call("visavis_next_due", this.pointer);
  }

  /** The next block if it is due, as one buffer: numbers of all frames (f64), then joints, and shares where there are any (f32); else null. */
  poll(now) {
    const outcome = this.core.call("visavis_poll", this.pointer, now);
    if (outcome < 0) throw VisavisError.ofStatus(-outcome, this.core.text());
    if (outcome === 0) return null;
    const numbers = BLOCK_FRAMES * FRAME_NUMBERS * 8, joints = BLOCK_FRAMES * this.joints * JOINT_NUMBERS * 4;
    const shares = this.core.call("visavis_shares_length", this.pointer) * 4;
    const block = new Uint8Array(numbers + joints + shares);
    const part = (name, at, bytes) => block.set(new Uint8Array(this.core.buffer, this.core.call(name, this.pointer), bytes), at);
    part("visavis_numbers", 0, numbers);
    part("visavis_joints", numbers, joints);
    part("visavis_shares", numbers + joints, shares);
    return block.buffer;
  }

  stats() {
    this.core.call("visavis_stats", this.pointer);
    return { ...JSON.parse(this.core.text()), memoryBytes: this.core.memoryBytes };
  }

  close() {
    this.core.call("visavis_session_free", this.pointer);
  }
}
