// Blocks to frames, and the frame to show now.

import { FRAME_NUMBERS, JOINT_NUMBERS } from "./core.js";

const BLOCK_FRAMES = 4;
const FPS = 30;

/** The frames of a block (`SessionCore.poll`): views into its buffer. */
export function framesOf(block, joints) {
  const numbers = new Float64Array(block, 0, BLOCK_FRAMES * FRAME_NUMBERS);
  const floats = new Float32Array(block, numbers.byteLength), size = joints * JOINT_NUMBERS;
  const shares = floats.subarray(BLOCK_FRAMES * size);
  return Array.from({ length: BLOCK_FRAMES }, (_, i) => {
    const [index, time, x, z, yaw, hx, hy, hz, fitError, gaze, sampler, held] = numbers.subarray(i * FRAME_NUMBERS, (i + 1) * FRAME_NUMBERS);
    return {
      index, time, root: { x, z, yaw }, hips: [hx, hy, hz], fitError, gaze: Number.isNaN(gaze) ? null : gaze,
      sampler: samplerName(sampler), held, joints: floats.subarray(i * size, (i + 1) * size),
      dyadic: shares.length ? shares.subarray(i * joints, (i + 1) * joints) : null,
    };
  });
}

const samplerName = (number) => (number === 0 ? "single" : number > 0 ? `midpoint${number}` : `euler:${-number}`);

/** The last second of frames. */
export class Recent {
  #frames = [];

  push(frames) {
    this.#frames.push(...frames);
    this.#frames.splice(0, this.#frames.length - FPS);
  }

  clear() {
    this.#frames.length = 0;
  }

  /** The frames around `time`: `frame`, `next`, and how far it is from one to the other, 0 to 1; null before the first. */
  at(time) {
    const frames = this.#frames;
    if (frames.length === 0) return null;
    let i = frames.length - 1;
    while (i > 0 && frames[i].time > time) i -= 1;
    const next = frames[Math.min(i + 1, frames.length - 1)];
    const fraction = next === frames[i] ? 0 : Math.min(1, Math.max(0, (time - frames[i].time) * FPS));
    return { frame: frames[i], next, fraction };
  }
}
