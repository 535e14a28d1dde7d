// Browser and Node beside native, one thread, in turns: web/bench/run [ROUNDS] [BLOCKS] [BUNDLE]
import { execFileSync } from "node:child_process";
import { fileURLToPath } from "node:url";
import { root } from "../tests/load.js";
import { chromium, serve } from "../tests/serve.js";

const [rounds, blocks, bundle] = [Number(process.argv[2] ?? 5), Number(process.argv[3] ?? 200), process.argv[4] ?? "models/visavis-room-i8.safetensors"];
const BLOCK_MS = 4000 / 30;
const SAMPLERS = ["midpoint4", "single"];
const cwd = fileURLToPath(root);

const server = await serve();
const browser = await chromium();

const native = (level) => (sampler) => {
  const arguments_ = ["bench", "--model", bundle, "--sampler", sampler, "--threads", "1", "--blocks", `${blocks}`, "--no-cold-start", "--json"];
  const text = execFileSync("target/release/visavis", arguments_, { cwd, env: { ...process.env, VISAVIS_CPU: level }, encoding: "utf8" });
  const [p50, , , max] = JSON.parse(text).benches[0].block_ms;
  return { p50, max };
};
const node = (module) => (sampler) => {
  // Relaxed SIMD is behind a flag in Node 20, and a flag that Node does not know is an error.
  const flags = process.allowedNodeEnvironmentFlags && Number(process.versions.node.split(".")[0]) < 22 ? ["--experimental-wasm-relaxed-simd"] : [];
  const request = JSON.stringify({ bundle, module, sampler, blocks });
  return JSON.parse(execFileSync(process.execPath, [...flags, "web/bench/node.js", request], { cwd, encoding: "utf8" }));
};
const page = (module) => async (sampler) => {
  const page = await browser.newPage();
  await page.goto(server.url);
  const answer = await page.evaluate(async (request) => {
    const { Visavis } = await import("/out/web/npm/index.js");
    const { measure } = await import("/web/bench/measure.js");
    return measure(Visavis, request);
  }, { bundle: `/${bundle}`, module, sampler, blocks });
  await page.close();
  return answer;
};

const who = {
  "native, AVX-512": native("avx512"), "native, AVX2": native("avx2"),
  "Node, relaxed": node("relaxed"), "Node, simd128": node("simd128"),
  "Chromium, relaxed": page("relaxed"), "Chromium, simd128": page("simd128"),
};
const times = new Map();
const skipped = new Set();
for (let round = 0; round < rounds; round++) {
  for (const [name, run] of Object.entries(who)) {
    for (const sampler of SAMPLERS) {
      if (skipped.has(name)) continue;
      try {
        const key = `${name}|${sampler}`;
        times.set(key, [...(times.get(key) ?? []), await run(sampler)]);
      } catch (error) {
        skipped.add(name);
        console.error(`${name} left out: ${String(error.stderr || error.message).trim().split("\n").at(-1)}`);
      }
    }
  }
}
await browser.close();
server.close();

const median = (values) => values.toSorted((a, b) => a - b)[Math.floor(values.length / 2)];
console.log(`${bundle}, ${rounds} rounds in turns of ${blocks} blocks; medians of the rounds. Times real time are of the median block.\n`);
console.log("| one thread | sampler | block, ms | worst block, ms | times real time | worst of all rounds, ms |\n|---|---|---|---|---|---|");
for (const [key, runs] of times) {
  const [name, sampler] = key.split("|");
  const [p50, max] = ["p50", "max"].map((k) => median(runs.map((r) => r[k])));
  const worst = Math.max(...runs.map((r) => r.max));
  console.log(`| ${name} | ${sampler} | ${p50.toFixed(2)} | ${max.toFixed(1)} | ${(BLOCK_MS / p50).toFixed(1)} | ${worst.toFixed(1)} |`);
}
