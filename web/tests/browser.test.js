// The package in headless Chromium, in its Worker. MODULES (default "simd128 relaxed") names the modules.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test, { after, before } from "node:test";
import { cases } from "./scene.js";
import { chromium, serve } from "./serve.js";

const modules = (process.env.MODULES ?? "simd128 relaxed").split(" ");
const all = cases(readFileSync(new URL("digests.txt", import.meta.url), "utf8"));
let server, browser, page;

before(async () => {
  server = await serve();
  browser = await chromium();
  page = await browser.newPage();
  await page.goto(server.url);
});
after(async () => {
  await browser?.close();
  server?.close();
});

for (const module of modules) {
  for (const bundle of new Set(all.map((c) => c.bundle))) {
    test(`motion is native's, ${module}, ${bundle}`, async () => {
      const wanted = all.filter((c) => c.bundle === bundle);
      const got = await page.evaluate(async (module, bundle, wanted) => {
        const { Visavis } = await import("/out/web/npm/index.js");
        const { motion } = await import("/web/tests/scene.js");
        const engine = await Visavis.load({ bundle: `/${bundle}`, module });
        const digests = [];
        for (const one of wanted) digests.push(await motion(engine, one));
        engine.close();
        return { module: engine.facts.module, digests };
      }, module, bundle, wanted);
      assert.equal(got.module, module);
      assert.deepEqual(got.digests, wanted.map((c) => c.digest));
    });
  }
}

test("blocks come in real time, one block ahead of what is shown", async () => {
  const seen = await page.evaluate(async (module) => {
    const { Visavis } = await import("/out/web/npm/index.js");
    const progress = [];
    const engine = await Visavis.load({ bundle: "/tests/goldens/tiny.safetensors", module, onProgress: (p) => progress.push(p) });
    const session = engine.session({ sampler: "single" });
    await session.ready;
    session.pushUserHead(0, 1.6, 1.5);
    const times = [];
    await new Promise((resolve) => {
      session.onFrames = (frames) => times.push(frames[0].time) === 5 && resolve();
    });
    const shown = session.shown();
    const answer = { times, shown: shown.frame.time, time: session.time, progress: progress.at(-1).loaded };
    engine.close();
    return answer;
  }, modules[0]);
  assert.deepEqual(seen.times.map((t) => Math.round(t * 30)), [0, 4, 8, 12, 16]);
  assert.ok(seen.time >= 16 / 30 && seen.shown <= seen.time, JSON.stringify(seen));
  assert.ok(seen.progress > 100_000);
});

test("errors are typed, and leave the page alive", async () => {
  const kinds = await page.evaluate(async (module) => {
    const { Visavis, VisavisError } = await import("/out/web/npm/index.js");
    const of = (promise) => promise.then(() => "none", (e) => (e instanceof VisavisError ? e.kind : `${e}`));
    const tiny = "/tests/goldens/tiny.safetensors";
    const engine = await Visavis.load({ bundle: tiny, module });
    const answer = [
      await of(Visavis.load({ bundle: new Uint8Array(9), module })),
      await of(Visavis.load({ bundle: "/nowhere.safetensors", module })),
      await of(Visavis.load({ bundle: tiny, module, worker: "/nowhere.js" })),
      await of(Visavis.load({ bundle: tiny, module, wasm: { [module]: "/nowhere.wasm" } })),
      await of(engine.session({ gaze: 9 }).ready),
      await of(engine.session({ sampler: "best" }).ready),
    ];
    engine.close();
    return answer;
  }, modules[0]);
  assert.deepEqual(kinds, ["bundle-corrupt", "io", "fault", "io", "argument", "argument"]);
});
