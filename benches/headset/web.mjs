// Blocks of a session between two markers, in an emulated JavaScript engine; see `web`.
// node web.mjs BUNDLE MODULE SAMPLER BLOCKS
import { readFileSync } from "node:fs";
import { Visavis } from "../../out/web/npm/index.js";
import { fill } from "../../web/tests/scene.js";

const [bundle, module, sampler, blocks] = process.argv.slice(2);
const engine = await Visavis.load({ bundle: readFileSync(bundle), module, inline: true });
const session = engine.session({ sampler, clock: "manual" });
const mark = () => process.umask(0o22);
const until = (block) => session.advance((block * 4) / 30 - 0.01 - session.time);
fill(session, Number(blocks) + 8);
// What is compiled or allocated once is no block's; a session's history is full from the start.
await until(8);
mark();
await until(8 + Number(blocks));
mark();
console.log(JSON.stringify({ level: engine.facts.level, blocks: Number(blocks), anchorings: (await session.stats()).anchorings }));
engine.close();
