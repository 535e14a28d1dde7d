// The agent: engine and session of the npm package, in a worker that the page brings along, and what of it is shown now.
import { Visavis } from "visavis";

export const BLOCK = 4 / 30;
// A block is computed when it is due and shown this much later: a block, and a tenth of one for its computation.
const DELAY = 1.1 * BLOCK;

export async function createAgent({ bundle, wasm, worker, onError, ...options }) {
  if (typeof Worker !== "function") throw new Error("The agent cannot run: this browser has no workers.");
  let engine = null, session = null, compact = new WeakMap(), latest = 0, resting = null;

  // Another bundle makes the motion from now on, what fails leaves the one that is there. Options may be a function, asked when the session starts.
  async function become(bundle, options) {
    const next = await Visavis.load({ bundle, wasm, worker });
    try {
      if (engine && JSON.stringify(next.facts.joints) !== JSON.stringify(engine.facts.joints)) throw new Error("its rig is another one than the page's body");
      const fresh = next.session(typeof options === "function" ? options() : options);
      fresh.delay = DELAY;
      await fresh.ready;
      // Two people who are there and say nothing: a voice that was never pushed is absent, which is another condition.
      fresh.setVoicePresent("agent", true);
      fresh.setVoicePresent("user", true);
      fresh.onError = (error) => session === fresh && onError(error);
      fresh.onFrames = (frames) => {
        if (session !== fresh) return;
        latest = frames[frames.length - 1].time + 1 / 30;
        agent.onBlock?.(frames);
      };
      // The last picture stays until the first block is there.
      if (session) resting = { ...agent.at().from, index: -1, time: 0, dyadic: null };
      engine?.close();
      [engine, session, compact, latest] = [next, fresh, new WeakMap(), 0];
    } catch (error) {
      next.close();
      throw error;
    }
  }

  // As the stage takes it; a frame has eleven numbers a joint, of which the first four are its local rotation.
  function staged(frame) {
    let made = compact.get(frame);
    if (made) return made;
    const joints = agent.facts.joints.length, local = new Float32Array(4 * joints);
    for (let j = 0; j < joints; j++) local.set(frame.joints.subarray(11 * j, 11 * j + 4), 4 * j);
    made = { index: frame.index, time: frame.time, root: [frame.root.x, frame.root.z], yaw: frame.root.yaw, hips: frame.hips, local, gaze: frame.gaze ?? NaN, user: null, dyadic: frame.dyadic };
    compact.set(frame, made);
    return made;
  }

  // The rig at rest, arms down, until the first block is there.
  function rest() {
    const { joints } = agent.facts, local = new Float32Array(4 * joints.length);
    for (let j = 0; j < joints.length; j++) local[4 * j + 3] = 1;
    const drop = { leftUpperArm: -1.25, rightUpperArm: 1.25 };
    joints.forEach(({ name }, j) => drop[name] && local.set([0, 0, Math.sin(drop[name] / 2), Math.cos(drop[name] / 2)], 4 * j));
    return { index: -1, time: 0, root: [0, 0], yaw: 0, hips: [...joints[0].offset], local, gaze: NaN, user: null };
  }

  const agent = {
    become,
    get facts() { return engine.facts; },
    get session() { return session; },
    now: () => session.time,
    // Session time of what is seen and heard now.
    shown: () => session.time - session.delay,
    // Session time up to which blocks are there.
    computed: () => latest,
    at() {
      const found = session.shown();
      if (!found) { resting ??= rest(); return { from: resting, to: resting, share: 0, late: 0 }; }
      return { from: staged(found.frame), to: staged(found.next), share: found.fraction, late: Math.max(0, agent.shown() - found.next.time) };
    },
    close: () => engine.close(),
  };
  await become(bundle, options);
  return agent;
}
