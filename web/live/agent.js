// The agent: engine and session of the npm package, the frames that are shown, and the clock that picture and sound share.
//
// Session time runs with performance.now(). A block is computed when it is due and shown `DELAY` later: one block, and a tenth of one for
// its computation. What a page shows and plays at session time t is what the session made for t - DELAY.
import { Visavis } from "visavis";

export const BLOCK = 4 / 30;
export const DELAY = 1.1 * BLOCK;
const KEPT = 24;

export async function createAgent({ bundle, onProgress, onError, gaze, sampler, seed = 1 }) {
  const engine = await Visavis.load({ bundle, onProgress });
  const session = await engine.session({ sampler, gaze, seed });
  const joints = engine.rig.joints.length;
  const frames = [];
  let latest = 0, resting = null;

  session.onError = onError;
  session.onFrames = (block) => {
    for (const frame of block) frames.push(toStage(frame));
    frames.splice(0, Math.max(0, frames.length - KEPT));
    latest = frames[frames.length - 1].time + 1 / 30;
    agent.onBlock?.(latest);
  };

  function toStage(frame) {
    const { root, hips } = frame;
    return { ...frame, root: [root.x, root.z], yaw: root.yaw, hips: [...hips], gaze: frame.gaze ?? NaN, user: null };
  }

  // The rig's rest pose, until the first block is there.
  function rest() {
    const local = new Float32Array(4 * joints);
    for (let j = 0; j < joints; j++) local[4 * j + 3] = 1;
    const drop = { leftUpperArm: -1.25, rightUpperArm: 1.25 };
    engine.rig.joints.forEach(({ name }, j) => drop[name] && local.set([0, 0, Math.sin(drop[name] / 2), Math.cos(drop[name] / 2)], 4 * j));
    return { time: 0, root: [0, 0], yaw: 0, hips: [...engine.rig.joints[0].offset], local, gaze: NaN, user: null };
  }

  const agent = {
    rig: engine.rig,
    module: engine.module,
    name: engine.name,
    session,
    // Seconds of the session, and of what is shown and heard now.
    now: () => session.now(),
    shown: () => session.now() - DELAY,
    // Session time up to which blocks have been computed.
    computed: () => latest,
    // The two frames about the shown time.
    at() {
      const time = agent.shown();
      resting ??= rest();
      if (!frames.length || time < frames[0].time) { const only = frames[0] ?? resting; return { from: only, to: only, share: 0, late: 0 }; }
      let i = frames.length - 1;
      while (i > 0 && frames[i].time > time) i--;
      const from = frames[i], to = frames[Math.min(i + 1, frames.length - 1)];
      return { from, to, share: Math.min(1, (time - from.time) * 30), late: Math.max(0, time - from.time - 1 / 30) };
    },
    close: () => session.close(),
  };
  return agent;
}
