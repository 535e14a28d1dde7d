// The bundled page (pack/run) in Chromium.
import assert from "node:assert/strict";
import { chromium, serve } from "../serve.js";

const server = await serve();
const browser = await chromium();
try {
  const page = await browser.newPage();
  await page.goto(server.url);
  const frames = await page.evaluate(async () => {
    globalThis.BASE = new URL("/out/web/pack/", location.href);
    globalThis.WASM = true;
    await import("/out/web/pack/page.js");
    return globalThis.FRAMES;
  });
  assert.equal(frames, 60);
  console.log("ok   the bundled page in Chromium");
} finally {
  await browser.close();
  server.close();
}
