#!/usr/bin/env node
// usage: check.mjs OUT SCREENSHOTS [NAME ...]
// Tries the live page (OUT/visavis.html from disk, OUT/site served) in headless Chromium as a person would; NAMEs: only these. By web/page_check.sh.
import { mkdirSync, readFileSync, rmSync, symlinkSync, writeFileSync } from "node:fs";
import { execFileSync } from "node:child_process";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { extname, join, resolve } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { vrmOf } from "./testvrm.mjs";

const [out, shots] = process.argv.slice(2, 4).map((p) => resolve(p)), only = process.argv.slice(4);
const require = createRequire(join(out, "build/package.json"));
const puppeteer = require("puppeteer-core");
const iwer = readFileSync(join(out, "build/node_modules/iwer/build/iwer.min.js"), "utf8");
const one = pathToFileURL(join(out, "visavis.html")).href;
mkdirSync(shots, { recursive: true });

const ARGS = ["--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking", "--disable-dev-shm-usage",
  "--autoplay-policy=no-user-gesture-required", "--disable-renderer-backgrounding", "--disable-backgrounding-occluded-windows"];
const HEAR = ["--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream", "--allow-file-access-from-files"];
let browser = null, failures = 0;
const open = async (args = []) => (browser = await puppeteer.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", headless: true, args: [...ARGS, ...args], protocolTimeout: 240000 }));
const sleep = (seconds) => new Promise((done) => setTimeout(done, 1000 * seconds));
const data = (page) => page.evaluate(() => ({ ...document.documentElement.dataset, failure: document.getElementById("failure").textContent }));
function claim(holds, what) { if (!holds) throw new Error(what); }
async function until(page, what, holds, seconds = 90) {
  const end = Date.now() + 1000 * seconds;
  for (;;) {
    const d = await data(page);
    if (holds(d)) return d;
    if (Date.now() > end || (d.state === "error" && !/error/.test(what))) throw new Error(`${what}: not within ${seconds} s; ${JSON.stringify(d)}`);
    await sleep(0.3);
  }
}
async function visit(url, { size = [1000, 640], before, hash = "theme=light&sampler=single&pixels=0.25" } = {}) {
  const page = await browser.newPage();
  await page.setViewport({ width: size[0], height: size[1] });
  if (before) await page.evaluateOnNewDocument(before);
  await page.goto(`${url}#${hash}`);
  return page;
}
const ready = (page) => until(page, "ready", (d) => d.state === "ready" && Number(d.frames) > 8);
const shot = async (page, name) => page.screenshot({ path: join(shots, `${name}.png`) });
// Angle from the agent's heading to the user, degrees.
const off = (d) => { const a = Number(d.bearing) - Number(d.yaw); return Math.abs(Math.atan2(Math.sin(a), Math.cos(a))) * 180 / Math.PI; };
// An agent that did nothing would be 90 degrees off a user who walked a quarter circle, a mirrored one 180; its body may well rest turned halfway, with the head doing the rest.
const TURNED = 65;
const wav = (seconds) => {
  const n = 16000 * seconds, b = Buffer.alloc(44 + 2 * n);
  b.write("RIFF", 0); b.writeUInt32LE(36 + 2 * n, 4); b.write("WAVEfmt ", 8); b.writeUInt32LE(16, 16); b.writeUInt16LE(1, 20); b.writeUInt16LE(1, 22);
  b.writeUInt32LE(16000, 24); b.writeUInt32LE(32000, 28); b.writeUInt16LE(2, 32); b.writeUInt16LE(16, 34); b.write("data", 36); b.writeUInt32LE(2 * n, 40);
  for (let i = 0; i < n; i++) b.writeInt16LE(9000 * Math.sin(i * 0.06) * (0.5 + 0.5 * Math.sin(i * 0.0012)), 44 + 2 * i);
  return b;
};
const drop = (page, bytes, name) => page.evaluate(async (text, name) => {
  const file = new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name), transfer = new DataTransfer();
  transfer.items.add(file);
  window.dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, cancelable: true }));
}, bytes.toString("base64"), name);

const checks = {
  async person() { // From disk: plays, turns to who walks, speaks, is interrupted, takes a gaze, a sound, a VRM; nothing is fetched.
    await open(HEAR);
    const page = await visit(one), requests = [];
    page.on("request", (r) => /^(http|ws)/.test(r.url()) && requests.push(r.url()));
    let d = await ready(page);
    await shot(page, "wide");
    claim(d.errors === "0" && /simd128|relaxed/.test(d.module), `ready with ${d.module}, ${d.errors} errors`);
    // A quarter circle round it.
    const before = Number(d.bearing);
    await page.keyboard.down("ArrowRight");
    await until(page, "walked a quarter circle", (x) => { const a = Number(x.bearing) - before; return Math.abs(Math.atan2(Math.sin(a), Math.cos(a))) > 1.4; });
    await page.keyboard.up("ArrowRight");
    d = await until(page, "the agent turned to the user", (x) => off(x) < TURNED, 60);
    console.log(`     turned: ${off(d).toFixed(0)} degrees off the user after a quarter circle`);
    await shot(page, "walked");
    await page.click("#lines button:nth-child(3)");
    await until(page, "speaks, and opens its mouth", (x) => x.speaking === "true" && Number(x.mouth) > 0.15, 30);
    // Found in step some time while it speaks: a machine that is busy loses it now and then, and the page finds it again.
    const behind = await page.evaluate(async () => {
      let least = Infinity;
      for (let i = 0; i < 60 && Math.abs(least) > 0.03; i++) {
        const now = window.visavisLive.behind();
        if (now !== null && Math.abs(now) < Math.abs(least)) least = now;
        await new Promise((r) => setTimeout(r, 50));
      }
      return least;
    });
    claim(Math.abs(behind) < 0.08, `sound ${behind} s off the picture`);
    console.log(`     sound against picture: ${(1000 * behind).toFixed(1)} ms`);
    await shot(page, "speaks");
    // Something long, which a slow machine cannot have finished before the button is pressed.
    await page.evaluate(() => window.visavisLive.say(Float32Array.from({ length: 50 * 24000 }, (_, i) => 0.2 * Math.sin(i * 0.05)), 24000, "a tone"));
    await until(page, "speaks at length", (x) => x.speaking === "true", 20);
    await page.click("#interrupt");
    d = await until(page, "interrupted", (x) => x.speaking === "false", 3);
    claim(d.interrupted === "1", "the interruption was not counted");
    const gaze = async (value) => page.evaluate((v) => { const g = document.getElementById("gaze"); g.value = v; g.dispatchEvent(new Event("input")); }, value);
    await gaze(0);
    claim(await page.$eval("#target", (e) => e.textContent) === "0.00", "the slider does not tell its value");
    await drop(page, wav(2), "tone.wav");
    await until(page, "a dropped sound is said", (x) => x.speaking === "true" && Number(x.mouth) > 0.1, 20);
    await drop(page, Buffer.from("nothing of use"), "notes.txt");
    d = await until(page, "a useless file is refused", (x) => /notes.txt cannot be used/.test(x.notice), 10);
    await gaze(0.8);
    await page.click("#microphone");
    d = await until(page, "the microphone is on or says why not", (x) => x.microphone === "on" || /No microphone/.test(x.notice ?? ""), 15);
    claim(d.microphone === "on", d.notice);
    await until(page, "the microphone's level moves", () => true, 1);
    claim(await page.evaluate(async () => { for (let i = 0; i < 60; i++) { if (Number(document.getElementById("level").style.getPropertyValue("--level")) > 0.05) return true; await new Promise((r) => setTimeout(r, 100)); } return false; }), "the level meter stays at nothing");
    const answer = await page.evaluate(() => new Promise((done) => { window.addEventListener("message", ({ data }) => data.visavis === "answer" && done(data)); window.postMessage({ visavis: "gaze", value: 3 }, "*"); }));
    claim(answer.ok === false && /0 to 1/.test(answer.error), "a wrong message is not refused");
    const facts = await page.evaluate(() => ({ ...window.visavisLive.agent.facts }));
    await drop(page, vrmOf(facts), "body.vrm");
    d = await until(page, "a VRM has the body", (x) => x.avatar === "Test body", 60);
    await sleep(2);
    await shot(page, "vrm");
    d = await data(page);
    claim(d.errors === "0" && requests.length === 0, `errors ${d.errors} ${d.failure}, requests ${requests}`);
    const stats = await page.evaluate(() => window.visavisLive.agent.session.stats());
    console.log(`     block median ${stats.blockMs.p50.toFixed(1)} ms (single step), worst ${stats.blockMs.max.toFixed(1)}; ${d.calls} draw calls, ${d.triangles} triangles`);
  },
  async phone() {
    await open();
    const page = await visit(one, { size: [390, 844], hash: "theme=dark&sampler=single" });
    await ready(page);
    await sleep(6);
    await shot(page, "phone");
  },
  async xr() { // A walk in VR, back to the screen, AR; and VR to AR without a pause.
    await open();
    const page = await visit(one, { before: `${iwer}; window.device = new IWER.XRDevice(IWER.metaQuest3); device.installRuntime({ forceInstall: true }); device.position.set(0, 1.6, 0);` });
    await ready(page);
    // iwer lays its canvas over the page: the button is pressed by script.
    const press = (mode) => page.$eval(`#${mode}`, (button) => button.click());
    const enter = (mode) => press(mode).then(() => until(page, `entered ${mode}`, (d) => d.mode === mode && /,1\.600,/.test(d.user), 30));
    const walk = async (mode) => {
      let d = await enter(mode);
      const { user: [x, , z], agent } = await page.evaluate(() => window.visavisLive.xr.first), far = Math.hypot(x - agent.x, z - agent.z);
      const ahead = off({ bearing: Math.atan2(x - agent.x, z - agent.z), yaw: agent.yaw });
      claim(far > 1.4 && far < 1.6 && ahead < 8, `${mode}: the user stands ${far.toFixed(2)} m away, not 1.5, ${ahead.toFixed(0)} degrees beside where the agent faces`);
      // A quarter circle round the agent, which is 1.5 m ahead, in five seconds.
      await page.evaluate(async () => {
        const { x, y, z } = device.position, h = 2 * Math.atan2(device.quaternion.y, device.quaternion.w), begun = performance.now();
        for (let t = 0; t < 1; t = Math.min(1, (performance.now() - begun) / 5000)) {
          const a = t * Math.PI / 2;
          device.position.set(x + 1.5 * (Math.sin(h + a) - Math.sin(h)), y, z + 1.5 * (Math.cos(h + a) - Math.cos(h)));
          device.quaternion.set(0, Math.sin((h + a) / 2), 0, Math.cos((h + a) / 2));
          await new Promise((r) => setTimeout(r, 16));
        }
      });
      d = await until(page, `${mode}: the agent turned to the head`, (s) => off(s) < TURNED, 60);
      const faced = await page.evaluate(() => {
        const { position: p, rotation: [x, y, z, w] } = window.visavisLive.user, [rx, rz] = document.documentElement.dataset.root.split(",").map(Number);
        const [fx, fz] = [2 * (x * z + w * y), 1 - 2 * (x * x + y * y)], far = Math.hypot(rx - p[0], rz - p[2]);
        return (fx * (rx - p[0]) + fz * (rz - p[2])) / far;
      });
      claim(faced > 0.85, `${mode}: the user's head, which looks at the agent, is said to look elsewhere (cosine ${faced.toFixed(2)})`);
      console.log(`     ${mode}: ${off(d).toFixed(0)} degrees off the head after a quarter circle`);
    };
    await walk("vr");
    await press("vr");
    await until(page, "left VR", (d) => d.mode === "screen", 20);
    await walk("vr");
    await walk("ar");
    await press("ar");
    const d = await until(page, "left AR", (x) => x.mode === "screen", 20);
    claim(d.errors === "0", `errors: ${d.failure}`);
  },
  async models() { // Another model by the panel, and one that is dropped: it goes on where it stands, and shows whom its joints follow.
    const two = join(out, "two"), goldens = fileURLToPath(new URL("../../tests/goldens/", import.meta.url));
    rmSync(two, { recursive: true, force: true });
    mkdirSync(two);
    for (const name of ["npm", "build"]) symlinkSync(join(out, name), join(two, name));
    const bundles = ["tiny", "dram-tcn"].map((name) => join(goldens, `${name}.safetensors`)).join(" ");
    execFileSync(process.execPath, [fileURLToPath(new URL("build.mjs", import.meta.url)), two], { env: { ...process.env, VISAVIS_BUNDLES: bundles } });
    await open();
    const page = await visit(pathToFileURL(join(two, "visavis.html")).href);
    let d = await ready(page);
    claim(d.model === "tiny" && d.kind === "sarah" && d.dyadic === "", `begins with ${d.model}, ${d.kind}, shares ${d.dyadic}`);
    const choose = (i) => page.evaluate((i) => { const list = document.getElementById("model"); list.selectedIndex = i; list.dispatchEvent(new Event("change")); }, i);
    const place = async () => (await data(page)).root.split(",").map(Number);
    let before = await place();
    await choose(1);
    d = await until(page, "the other model", (x) => x.kind === "dram" && Number(x.frames) > 8 && x.dyadic !== "", 30);
    const moved = Math.hypot(...(await place()).map((x, k) => x - before[k]));
    claim(moved < 0.4, `it jumped by ${moved.toFixed(2)} m`);
    claim(d.model === "tiny-tcn" && Number(d.dyadic) >= 0 && Number(d.dyadic) <= 1, `${d.model}, shares ${d.dyadic}`);
    claim(await page.$eval("#sampling", (e) => e.hidden) && !(await page.$eval("#whom", (e) => e.hidden)), "the panel still has the other model's settings");
    await shot(page, "dyadic");
    await choose(0);
    await until(page, "the first again", (x) => x.kind === "sarah" && x.model === "tiny" && Number(x.frames) > 8, 30);
    await drop(page, readFileSync(join(goldens, "dram-lstm.safetensors")), "other.safetensors");
    d = await until(page, "a dropped model", (x) => x.model === "tiny-lstm" && Number(x.frames) > 8, 30);
    await drop(page, Buffer.from("no model"), "broken.safetensors");
    d = await until(page, "a broken model is refused", (x) => /broken.safetensors cannot be used/.test(x.notice), 10);
    claim(d.model === "tiny-lstm" && d.errors === "0", `after that: ${d.model}, ${d.errors} errors`);
    console.log(`     ${d.notice}`);
  },
  async sounds() { // A model with hearing: sounds are dropped by a click, glow, sound, are heard from their place; one without says so.
    const two = join(out, "two"), goldens = fileURLToPath(new URL("../../tests/goldens/", import.meta.url));
    rmSync(two, { recursive: true, force: true });
    mkdirSync(two);
    for (const name of ["npm", "build"]) symlinkSync(join(out, name), join(two, name));
    const bundles = ["hearing", "tiny"].map((name) => join(goldens, `${name}.safetensors`)).join(" ");
    execFileSync(process.execPath, [fileURLToPath(new URL("build.mjs", import.meta.url)), two], { env: { ...process.env, VISAVIS_BUNDLES: bundles } });
    await open();
    const page = await visit(pathToFileURL(join(two, "visavis.html")).href, { hash: "theme=dark&sampler=single&pixels=0.5" });
    let d = await ready(page);
    claim(d.hearing === "true" && !(await page.$eval("#room", (e) => e.hidden)), "a model with hearing, but no sounds to drop");
    await page.click('#sounds button[data-name="music"]');
    await page.mouse.click(720, 380);
    d = await until(page, "music in the room", (x) => x.sounding === "music" && x.dropped === "1", 30);
    const [{ at }] = await page.evaluate(() => window.visavisLive.sounds.shown());
    claim(at[0] > 0.2 && Math.abs(at[1] - 0.9) < 1e-6, `it is at ${at}`);
    await sleep(1);
    await shot(page, "sound");
    await page.mouse.click(720, 40);
    await until(page, "not in the sky", (x) => /above the floor/.test(x.notice) && x.dropped === "1", 10);
    await page.keyboard.press("b");
    await until(page, "another behind it", (x) => x.dropped === "2", 10);
    const answer = (message) => page.evaluate((m) => new Promise((done) => { window.addEventListener("message", ({ data }) => data.visavis === "answer" && done(data), { once: false }); window.postMessage(m, "*"); }), message);
    claim((await answer({ visavis: "sound", name: "bark", at: [1, 0.4, 1] })).ok, "a sound by message");
    claim(/there are bang/.test((await answer({ visavis: "sound", name: "cow", at: [1, 0.4, 1] })).error), "an unknown sound is not refused");
    await page.evaluate(() => { const s = document.getElementById("sensitivity"); s.value = 1; s.dispatchEvent(new Event("input")); });
    claim(await page.$eval("#minds", (e) => e.textContent) === "sensitive", "the slider does not tell its value");
    const { sounds } = await page.evaluate(() => window.visavisLive.agent.session.stats());
    claim(sounds.started === 3 && sounds.refused === 0 && sounds.overflowSamples === 0, JSON.stringify(sounds));
    await page.evaluate(() => { const list = document.getElementById("model"); list.selectedIndex = 1; list.dispatchEvent(new Event("change")); });
    d = await until(page, "a model without hearing", (x) => x.model === "tiny" && x.hearing === "false" && x.sounding === "", 30);
    claim(await page.$eval("#room", (e) => e.hidden) && /hearing/.test(await page.$eval("#deaf", (e) => e.textContent)), "it does not say that it hears no sounds");
    claim(/hearing/.test((await answer({ visavis: "sound", name: "bark", at: [1, 0.4, 1] })).error) && (await data(page)).errors === "0", "a sound for it is not refused");
  },
  async broken() { // A sentence, not a blank page.
    await open();
    const says = async (name, page, words) => {
      const d = await until(page, `error: ${name}`, (x) => x.state === "error", 60);
      claim(words.test(d.failure), `${name}: ${d.failure}`);
      console.log(`     ${name}: ${d.failure}`);
      await page.close();
    };
    const html = readFileSync(join(out, "visavis.html"), "utf8"), at = html.indexOf('id="model0">') + 400;
    const file = join(out, "build/damaged.html");
    writeFileSync(file, html.slice(0, at) + "AAAABBBB" + html.slice(at + 8));
    await says("damaged", await visit(pathToFileURL(file).href), /damaged/);
    writeFileSync(file, html.slice(0, at) + "</script></body></html>");
    await says("cut short", await visit(pathToFileURL(file).href), /damaged|not saved/);
    await says("no WebGL", await visit(one, { before: "HTMLCanvasElement.prototype.getContext = () => null;" }), /WebGL 2/);
    await says("no WebAssembly", await visit(one, { before: "delete window.WebAssembly;" }), /WebAssembly/);
    await says("no SIMD", await visit(one, { before: "WebAssembly.validate = () => false;" }), /SIMD/);
    const page = await visit(one, { before: "navigator.mediaDevices.getUserMedia = () => Promise.reject(new DOMException('', 'NotFoundError'));" });
    await ready(page);
    await page.click("#microphone");
    const d = await until(page, "no microphone", (x) => /No microphone/.test(x.notice ?? ""), 10);
    claim(d.state === "ready", "the page stopped without a microphone");
    console.log(`     no microphone: ${d.notice}`);
  },
  async site() { // Served: progress, ready, and again without the server.
    const types = { ".html": "text/html", ".js": "text/javascript", ".gz": "application/octet-stream" };
    const server = createServer((request, answer) => {
      const name = request.url.replace(/[?#].*/, "").replace(/\/$/, "/index.html");
      try { const body = readFileSync(join(out, "site", name)); answer.writeHead(200, { "content-type": types[extname(name)] ?? "text/plain" }); answer.end(body); } catch { answer.writeHead(404); answer.end(); }
    });
    await new Promise((done) => server.listen(0, "127.0.0.1", done));
    await open();
    const url = `http://127.0.0.1:${server.address().port}/`, page = await visit(url);
    await ready(page);
    await page.waitForFunction(async () => (await navigator.serviceWorker.ready) && (await caches.keys()).length === 1 && (await (await caches.open((await caches.keys())[0])).keys()).length >= 7, { timeout: 60000 });
    await page.close();
    server.closeAllConnections();
    await new Promise((done) => server.close(done));
    await ready(await visit(url));
    console.log("     ready again without the server");
  },
  async memory() { // Minutes of blocks, as fast as they go: the module's memory and the page's heap stay.
    await open(["--js-flags=--expose-gc"]);
    const page = await visit(one);
    await ready(page);
    const [first, last] = await page.evaluate(async () => {
      const { agent, say } = window.visavisLive, at = async () => { window.gc?.(); return [(await agent.session.stats()).memoryBytes, performance.memory.usedJSHeapSize]; };
      for (let i = 0; i < 6; i++) await say(new Float32Array(4800).fill(0.01), 24000, "x");
      await new Promise((r) => setTimeout(r, 15000));
      const first = await at();
      for (let i = 0; i < 20; i++) { await say(new Float32Array(4800).fill(0.01), 24000, "x"); await new Promise((r) => setTimeout(r, 1500)); }
      return [first, await at()];
    });
    console.log(`     module ${first[0] / 1e6} to ${last[0] / 1e6} MB, heap ${(first[1] / 1e6).toFixed(1)} to ${(last[1] / 1e6).toFixed(1)} MB`);
    claim(last[0] === first[0], "the module's memory grew");
    claim(last[1] < first[1] + 4e6, "the page's heap grew by more than 4 MB");
  },
};

for (const [name, check] of Object.entries(checks)) {
  if (only.length && !only.includes(name)) continue;
  try { await check(); console.log(`ok   ${name}`); } catch (error) {
    failures++;
    console.log(`FAIL ${name}: ${error.message}`);
    const pages = await browser?.pages().catch(() => []);
    if (pages?.length) await shot(pages[pages.length - 1], `failed-${name}`).catch(() => {});
  }
  await browser?.close();
}
process.exit(failures ? 1 : 0);
