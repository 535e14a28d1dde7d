// The worker's side: owns the module's instance, an engine and its sessions, and drives sessions by the clock.

import { compile } from "./modules.js";
import { Core } from "./core.js";
import { VisavisError } from "./errors.js";

/** How often a session's clock is looked at, ms; a block is due every 133 ms. */
const TICK = 8;
/** A session that is further behind than this, s, loses the time (a laptop that slept) instead of computing it all. */
const LOST = 2;
/** Manual sessions compute this long, ms, before messages are looked at. */
const SLICE = 50;

const now = () => performance.timeOrigin + performance.now();

/** Serves a port (a worker's global scope, or one end of an inline pair). */
export function serve(port) {
  const sessions = new Map();
  let core = null, engine = null, light = null, timer = null;
  const own = { load, loadFallback };

  port.onmessage = async ({ data: { call, op, session: id, values } }) => {
    try {
      const value = await (Object.hasOwn(own, op) ? own[op](...values) : op === "session" ? open(id, ...values) : of(id)[op](...values));
      if (call) port.postMessage({ call, value });
    } catch (error) {
      const plain = (error instanceof VisavisError ? error : new VisavisError("other", String(error?.message ?? error))).toPlain();
      port.postMessage({ call, session: id, error: plain });
    }
  };

  async function load(wasm, bundle) {
    core = await Core.instantiate(await compile(wasm));
    engine = core.engine(bundle);
    return engine.facts;
  }

  /** Another bundle, for sessions to step down to; sessions keep the one that they have. */
  function loadFallback(bundle) {
    const loaded = core.engine(bundle);
    light?.close();
    light = loaded;
    return light.facts;
  }

  function open(id, options, clock, origin) {
    sessions.set(id, new Driven(id, engine.session(options), clock === "real" ? origin : null));
    timer ??= setInterval(tick, TICK);
  }

  function of(id) {
    const session = sessions.get(id);
    if (!session) throw new VisavisError("closed", "this session is closed: make another");
    return session;
  }

  function tick() {
    for (const session of sessions.values()) {
      try {
        session.tick();
      } catch (error) {
        session.stop();
        port.postMessage({ session: session.id, error: error.toPlain?.() ?? { message: String(error) } });
      }
    }
  }

  /** For who has no worker to end: nothing of the host goes on. */
  function stop() {
    clearInterval(timer);
    port.onmessage = null;
    sessions.clear();
  }

  /** A session with its clock. */
  class Driven {
    #session;
    #origin; // Wall time of session time 0, ms; null: by hand or paused.
    #paused = null; // Session time at which it was paused.
    #polled = 0; // Session time of the last poll: time does not run backwards.
    #ends = [0, 0]; // Session time at which all that was pushed of a voice has been heard.

    constructor(id, session, origin) {
      this.id = id;
      this.#session = session;
      this.#origin = origin;
    }

    tick() {
      if (this.#origin === null) return;
      let time = (now() - this.#origin) / 1000;
      const behind = time - this.#session.nextDue;
      if (behind > LOST) {
        const kept = Math.max(this.#session.nextDue, this.#polled);
        this.#origin += (time - kept) * 1000;
        time = kept;
        port.postMessage({ session: this.id, origin: this.#origin });
      }
      // One block at a time: messages come in between.
      this.#poll(time);
    }

    #poll(time) {
      this.#polled = time;
      const block = this.#session.poll(time);
      if (block) port.postMessage({ session: this.id, block }, [block]);
      return block !== null;
    }

    /** Session time at which the first of these samples is heard. */
    pushVoice(voice, samples, rate) {
      this.#session.pushVoice(voice, samples, rate);
      const starts = Math.max(this.#ends[voice], this.#session.nextDue);
      this.#ends[voice] = starts + samples.length / rate;
      return starts;
    }

    finishVoice(voice) {
      this.#session.finishVoice(voice);
    }

    clearVoice(voice) {
      this.#session.clearVoice(voice);
      this.#ends[voice] = 0;
    }

    setVoicePresent(voice, present) {
      this.#session.setVoicePresent(voice, present);
    }

    pushHead(x, y, z, time) {
      this.#session.pushHead(x, y, z, time);
    }

    pushPose(x, y, z, rotation, time) {
      this.#session.pushPose(x, y, z, rotation, time);
    }

    pushSound(id, samples, rate, position) {
      this.#session.pushSound(id, samples, rate, position);
    }

    endSound(id) {
      this.#session.endSound(id);
    }

    pushEars(left, right, rate) {
      this.#session.pushEars(left, right, rate);
    }

    endEars() {
      this.#session.endEars();
    }

    heardPlace() {
      return this.#session.heardPlace();
    }

    setSensitivity(sensitivity) {
      this.#session.setSensitivity(sensitivity);
    }

    setGaze(target) {
      this.#session.setGaze(target);
    }

    setSampler(name) {
      this.#session.setSampler(name);
    }

    setBudget(milliseconds) {
      this.#session.setBudget(milliseconds);
    }

    setFallback() {
      if (!light) throw new VisavisError("state", "there is no bundle to step down to: await engine.loadFallback(bundle) first");
      this.#session.setFallback(light);
    }

    reportBlockTime(milliseconds) {
      this.#session.reportBlockTime(milliseconds);
    }

    stats() {
      return this.#session.stats();
    }

    pause() {
      if (this.#origin === null) return;
      this.#paused = (now() - this.#origin) / 1000;
      this.#origin = null;
    }

    /** Goes on; the new wall time of session time 0, ms. */
    resume() {
      if (this.#paused === null) return this.#origin;
      this.#origin = now() - this.#paused * 1000;
      this.#paused = null;
      return this.#origin;
    }

    async advance(until) {
      let slice = now();
      while (this.#session.nextDue < until && sessions.has(this.id)) {
        this.#poll(until);
        if (now() - slice > SLICE) {
          await new Promise((resolve) => setTimeout(resolve));
          slice = now();
        }
      }
    }

    reset(origin) {
      this.#session.reset();
      this.#polled = 0;
      this.#ends = [0, 0];
      this.#paused = null;
      if (this.#origin !== null) this.#origin = origin;
    }

    stop() {
      this.#origin = this.#paused = null;
    }

    close() {
      sessions.delete(this.id);
      this.#session.close();
      if (sessions.size === 0) {
        clearInterval(timer);
        timer = null;
      }
    }
  }

  return stop;
}
