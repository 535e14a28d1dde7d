// Block times of one session, in Node or on a page.
import { fill } from "../tests/scene.js";

/** `{ p50, max }`, milliseconds, of `blocks` blocks with two voices and a head; the first ones warm up. */
export async function measure(Visavis, { bundle, module, sampler, blocks, warm = 30 }) {
  const engine = await Visavis.load({ bundle, module });
  const session = engine.session({ sampler, gaze: 0.8, clock: "manual" });
  // Compilers of engines tier up: what they took for is no block's.
  await session.advance((warm * 4) / 30);
  await session.reset();
  fill(session, Math.min(blocks, 400));
  await session.advance((blocks * 4) / 30 - 0.01);
  const { blockMs, blocks: done, anchorings } = await session.stats();
  engine.close();
  return { p50: blockMs.p50, max: blockMs.max, blocks: done, anchorings };
}
