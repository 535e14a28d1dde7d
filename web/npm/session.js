// A session as the page sees it. Pushes never wait and are never refused: they are messages to the worker.

import { VisavisError, argument, named } from "./errors.js";
import { Recent, framesOf } from "./frames.js";

const VOICES = { agent: 0, user: 1 };
const MAX_MINUTES_AHEAD = 1;

const wall = () => performance.timeOrigin + performance.now();

export class Session {
  onFrames = null;
  onError = null;
  /** Seconds between a moment and the frames that are shown then: a block, so that none is missed. */
  delay = 4 / 30;
  #link;
  #joints;
  #hears;
  #id;
  #recent = new Recent();
  #origin;
  #clock;
  #paused = null;
  #time = 0; // By hand.
  #ended = null;

  constructor(link, facts, id, { clock = "real", ...options }) {
    if (clock !== "real" && clock !== "manual") throw argument(`clock ${named(clock)}: "real" or "manual"`);
    checked(options);
    this.#link = link;
    this.#joints = facts.joints.length;
    this.#hears = facts.hasHearing;
    this.#id = id;
    this.#clock = clock;
    this.#origin = wall();
    link.listen(id, (message) => this.#receive(message));
    this.ready = link.ask("session", id, [options, clock, this.#origin]).then(() => this);
    this.ready.catch((error) => this.#fail(error));
  }

  /** Session time, seconds. */
  get time() {
    if (this.#clock === "manual") return this.#time;
    return this.#paused ?? (wall() - this.#origin) / 1000;
  }

  pushUserHead(x, y, z, time = this.time, rotation = null) {
    // Positions that are no numbers are counted (stats().head.nonFinite), as in every other language.
    [x, y, z, time].forEach((v) => typed("a head position", "numbers", typeof v === "number"));
    if (rotation === null) return this.#tell("pushHead", [x, y, z, time]);
    // A page's own array may be any kind of list: four numbers of it go.
    const turn = Array.from(typeof rotation === "object" ? rotation : []);
    typed("a head's rotation", "four numbers x, y, z, w, or null", turn.length === 4 && turn.every((v) => typeof v === "number"));
    this.#tell("pushPose", [x, y, z, turn, time]);
  }

  pushUserVoice(samples, rate) {
    this.#tell("pushVoice", [VOICES.user, ...voice(samples, rate)]);
  }

  /** Resolves to the session time at which the first sample is heard. */
  pushAgentVoice(samples, rate) {
    return this.#ask("pushVoice", [VOICES.agent, ...voice(samples, rate)]);
  }

  finishVoice(who) {
    this.#tell("finishVoice", [which(who)]);
  }

  clearVoice(who) {
    this.#tell("clearVoice", [which(who)]);
  }

  /** Breaks off what the agent says. */
  interrupt() {
    this.clearVoice("agent");
  }

  setVoicePresent(who, present) {
    this.#tell("setVoicePresent", [which(who), Boolean(present)]);
  }

  pushSound(id, samples, rate, position) {
    const piece = voice(samples, rate);
    const place = Array.from(position !== null && typeof position === "object" ? position : []);
    typed("the place of a sound", "three numbers x, y, z", place.length === 3 && place.every((v) => typeof v === "number"));
    this.#tell("pushSound", [this.#source(id), ...piece, place]);
  }

  endSound(id) {
    this.#tell("endSound", [this.#source(id)]);
  }

  pushEars(left, right, rate) {
    const [first, hertz] = voice(left, rate);
    const [second] = voice(right, rate);
    if (left.length !== right.length) throw argument(`${left.length} samples of the left ear and ${right.length} of the right one: push as many of both`);
    this.#mustHear();
    this.#tell("pushEars", [first, second, hertz]);
  }

  endEars() {
    this.#mustHear();
    this.#tell("endEars", []);
  }

  /** Resolves to [x, y, z], or null. */
  heardPlace() {
    return this.#ask("heardPlace", []);
  }

  setSensitivity(sensitivity) {
    if (!(Math.abs(number("sensitivity", sensitivity)) <= 1.5)) throw argument(`sensitivity ${sensitivity}: -1.5 to 1.5`);
    this.#tell("setSensitivity", [sensitivity]);
  }

  /** A source's number, where the bundle hears it. */
  #source(id) {
    typed("the number of a sound", "a whole number, 0 to 4294967295", Number.isInteger(id) && id >= 0 && id <= 0xffffffff);
    this.#mustHear();
    return id;
  }

  #mustHear() {
    if (!this.#hears) throw argument("this bundle has no hearing, so no sound is heard: load one whose facts.hasHearing is true");
  }

  setGaze(target) {
    if (target !== null && !(number("gaze", target) >= -1 && target <= 1)) throw argument(`gaze ${target}: -1 to 1, or null for free gaze`);
    this.#tell("setGaze", [target]);
  }

  setSampler(name) {
    typed("a sampler", "a string", typeof name === "string");
    return this.#ask("setSampler", [name]);
  }

  setBudget(milliseconds) {
    return this.#ask("setBudget", [number("budget", milliseconds)]);
  }

  setFallback() {
    return this.#ask("setFallback", []);
  }

  reportBlockTime(milliseconds) {
    return this.#ask("reportBlockTime", [number("a block's time", milliseconds)]);
  }

  stats() {
    return this.#ask("stats", []);
  }

  pause() {
    if (this.#clock === "manual" || this.#paused !== null) return;
    this.#paused = this.time;
    this.#tell("pause", []);
  }

  async resume() {
    if (this.#paused === null) return;
    this.#origin = await this.#ask("resume", []);
    this.#paused = null;
  }

  /** Computes `seconds` of session time as fast as it goes. */
  async advance(seconds) {
    if (this.#clock !== "manual") throw new VisavisError("state", "advance is for sessions with clock: \"manual\"");
    if (!(number("seconds", seconds) >= 0 && seconds <= 86400)) throw argument(`seconds is ${seconds}: 0 to 86400`);
    this.#time += seconds;
    await this.#ask("advance", [this.#time]);
  }

  async reset() {
    this.#origin = wall();
    this.#time = 0;
    if (this.#paused !== null) this.#paused = 0;
    await this.#ask("reset", [this.#origin]);
    this.#recent.clear();
  }

  shown(time = this.time) {
    return this.#recent.at(time - this.delay);
  }

  close() {
    if (this.#ended) return;
    this.#tell("close", []);
    this.#ended = new VisavisError("closed", "this session is closed: make another");
    this.#link.forget(this.#id);
  }

  #tell(op, values) {
    if (this.#ended) throw this.#ended;
    this.#link.tell(op, this.#id, values);
  }

  #ask(op, values) {
    return this.#ended ? Promise.reject(this.#ended) : this.#link.ask(op, this.#id, values);
  }

  #receive({ block, origin, error }) {
    if (error) return this.#fail(error);
    if (origin !== undefined) this.#origin = origin;
    if (!block) return;
    const frames = framesOf(block, this.#joints);
    this.#recent.push(frames);
    this.onFrames?.(frames);
  }

  #fail(error) {
    if (error.kind === "fault") this.#ended = error;
    this.onError?.(error);
  }
}

/** What JSON would turn into null, or cannot hold, is told here; ranges are the module's business. */
function checked(options) {
  for (const [name, value] of Object.entries(options)) {
    const values = Array.isArray(value) ? value : [value];
    values.forEach((v) => typeof v === "number" && number(name, v));
    typed(`option ${name}`, "a number, a string, a boolean, null, or numbers", values.every(plain));
  }
  if (typeof options.gaze === "string") throw argument(`gaze ${JSON.stringify(options.gaze)}: a number or null`);
}

const plain = (value) => value === null || ["number", "string", "boolean", "undefined"].includes(typeof value);

function which(who) {
  if (!Object.hasOwn(VOICES, who)) throw argument(`voice ${named(who)}: "agent" or "user"`);
  return VOICES[who];
}

function voice(samples, rate) {
  if (!(samples instanceof Float32Array)) throw argument("samples: a Float32Array of mono sound, full scale 1");
  if (!Number.isInteger(rate) || rate < 8000 || rate > 192000) throw new VisavisError("audio", `a rate of ${named(rate)} Hz: 8000 to 192000`);
  if (samples.length > 60 * MAX_MINUTES_AHEAD * rate) throw new VisavisError("audio", "more than a minute of sound at once: push it in pieces as it is heard");
  // A copy: the page goes on writing to its own.
  return [samples.slice(), rate];
}

function number(name, value) {
  if (typeof value !== "number" || !Number.isFinite(value)) throw argument(`${name} is ${named(value)}: a finite number`);
  return value;
}

function typed(what, expected, right) {
  if (!right) throw argument(`${what}: ${expected}`);
}
