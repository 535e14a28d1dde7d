// The same motion, to the bit, as natively (digests.txt), with both modules. VISAVIS_SCALAR names a module built without SIMD,
// which no package has: web/module.sh +sign-ext visavis-web --profile dist
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
import { cases, motion } from "./scene.js";
import { load } from "./closing.js";

const modules = [{ module: "simd128" }, { module: "relaxed" }];
if (process.env.VISAVIS_SCALAR) modules.push({ module: "simd128", wasm: { simd128: readFileSync(process.env.VISAVIS_SCALAR) }, name: "scalar" });

const all = cases(readFileSync(new URL("digests.txt", import.meta.url), "utf8"));
const bundles = new Set(all.map(({ bundle }) => bundle));
assert.ok(bundles.size >= 5, [...bundles].join(" "));

for (const { name, ...chosen } of modules) {
  for (const bundle of bundles) {
    test(`${name ?? chosen.module}, ${bundle}`, async () => {
      const engine = await load({ bundle, ...chosen });
      const wanted = all.filter((c) => c.bundle === bundle);
      if (name) assert.equal(engine.facts.level, name);
      for (const one of wanted) assert.equal(await motion(engine, one), one.digest, `${JSON.stringify(one.options)} on ${engine.facts.level}`);
      engine.close();
    });
  }
}
