// The same motion, to the bit, as natively (digests.txt), with both modules.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
import { cases, motion } from "./scene.js";
import { load, root } from "./load.js";

for (const module of ["simd128", "relaxed"]) {
  for (const bundle of ["tests/goldens/tiny.safetensors", "models/visavis-base-i8.safetensors"]) {
    test(`${module}, ${bundle}`, async () => {
      const engine = await load({ bundle, module });
      const wanted = cases(readFileSync(new URL("digests.txt", import.meta.url), "utf8")).filter((c) => c.bundle === bundle);
      assert.ok(wanted.length > 1);
      for (const one of wanted) assert.equal(await motion(engine, one), one.digest, `${JSON.stringify(one.options)} on ${engine.facts.level}`);
      engine.close();
    });
  }
}
void root;
