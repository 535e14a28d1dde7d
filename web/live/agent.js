// The agent: engine and session of the npm package, in a worker that the page brings along, and what of it is shown now.
import { Visavis } from "visavis";

export const BLOCK = 4 / 30;
// A block is computed when it is due and shown this much later: a block, and a tenth of one for its computation.
const DELAY = 1.1 * BLOCK;

export async function createAgent({ bundle, wasm, worker, onError, ...options }) {
  if (typeof Worker !== "function") throw new Error("The agent cannot run: this browser has no workers.");
  const engine = await Visavis.load({ bundle, wasm, worker });
  const session = engine.session(options), { facts } = engine;
  const compact = new WeakMap();
  let latest = 0, resting = null;
  session.delay = DELAY;
  session.onError = onError;
  // Two people who are there and say nothing: a voice that was never pushed is absent, which is another condition.
  session.setVoicePresent("agent", true);
  session.setVoicePresent("user", true);
  session.onFrames = (frames) => {
    latest = frames[frames.length - 1].time + 1 / 30;
    agent.onBlock?.(frames);
  };
  await session.ready;

  // As the stage takes it; a frame has eleven numbers a joint, of which the first four are its local rotation.
  function staged(frame) {
    let made = compact.get(frame);
    if (made) return made;
    const local = new Float32Array(4 * facts.joints.length);
    for (let j = 0; j < facts.joints.length; j++) local.set(frame.joints.subarray(11 * j, 11 * j + 4), 4 * j);
    made = { index: frame.index, time: frame.time, root: [frame.root.x, frame.root.z], yaw: frame.root.yaw, hips: frame.hips, local, gaze: frame.gaze ?? NaN, user: null };
    compact.set(frame, made);
    return made;
  }

  // The rig at rest, arms down, until the first block is there.
  function rest() {
    const local = new Float32Array(4 * facts.joints.length);
    for (let j = 0; j < facts.joints.length; j++) local[4 * j + 3] = 1;
    const drop = { leftUpperArm: -1.25, rightUpperArm: 1.25 };
    facts.joints.forEach(({ name }, j) => drop[name] && local.set([0, 0, Math.sin(drop[name] / 2), Math.cos(drop[name] / 2)], 4 * j));
    return { index: -1, time: 0, root: [0, 0], yaw: 0, hips: [...facts.joints[0].offset], local, gaze: NaN, user: null };
  }

  const agent = {
    facts,
    session,
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
  return agent;
}
