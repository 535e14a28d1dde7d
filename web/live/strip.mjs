#!/usr/bin/env node
// usage: strip.mjs OUT PICTURE.png
// The film strip of the README: six pictures of the live page, taken while a script does what a person would. OUT is out/web.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { vrmOf } from "./testvrm.mjs";

const [out, picture] = process.argv.slice(2).map((p) => resolve(p));
const puppeteer = createRequire(join(out, "build/package.json"))("puppeteer-core");
const browser = await puppeteer.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", headless: true, protocolTimeout: 240000,
  args: ["--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--autoplay-policy=no-user-gesture-required"],
});
const page = await browser.newPage();
await page.setViewport({ width: 480, height: 400 });
await page.goto(`${pathToFileURL(join(out, "visavis.html")).href}#theme=light&sampler=single`);
const sleep = (s) => new Promise((done) => setTimeout(done, 1000 * s));
const data = () => page.evaluate(() => ({ ...document.documentElement.dataset }));
// A slow machine may not see the moment: then the picture is of the next best.
const until = async (holds, seconds = 15) => { for (const end = Date.now() + 1000 * seconds; Date.now() < end && !holds(await data());) await sleep(0.1); };
const live = (code) => page.evaluate(code);
await until((d) => Number(d.frames) > 20, 120);
const style = "#desk, #notice, header, nav { display: none !important; }";
await page.addStyleTag({ content: style });

const shots = [];
const take = async (words) => shots.push({ words, image: `data:image/png;base64,${await page.screenshot({ encoding: "base64" })}` });
const place = (x, y, z) => live(`visavisLive.user.position = [${x}, ${y}, ${z}]`);
await place(1.5, 1.6, 0.6); await sleep(5); await take("walk around it");
await place(0.5, 1.6, 1.3); await sleep(6);
// With its mouth open and its eyes too.
for (let i = 0; i < 20; i++) {
  if ((await data()).speaking !== "true") await page.evaluate(() => document.querySelector("#lines button:nth-child(3)").click());
  await until((d) => d.speaking === "true" && Number(d.mouth) > 0.35, 8);
  if (i) shots.pop();
  await take("let it speak");
  if (await live("visavisLive.face.open > 0.3 && visavisLive.face.blink < 0.2")) break;
}
await live("visavisLive.interrupt()"); await sleep(1.2); await take("interrupt it");
await live("visavisLive.setGaze(0)"); await sleep(8); await take("less eye contact");
await live("visavisLive.setGaze(1)"); await place(0.5, 1.6, 1.35);
const facts = await live("({ ...visavisLive.agent.facts })"), bytes = vrmOf(facts).toString("base64");
await page.evaluate((text) => visavisLive.take(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], "body.vrm")), bytes);
await until((d) => d.avatar, 60); await until((d) => Number(d.gaze) > 0.9, 20); await sleep(1); await take("a VRM drives along");
await page.evaluate(() => document.getElementById("own-body").click());
await live("(() => { const n = 48000, s = new Float32Array(n); for (let i = 0; i < n; i++) s[i] = 0.4 * Math.sin(i * 0.05) * Math.sin(i * 0.0006) ** 2; visavisLive.say(s, 24000, 'a sound'); })()");
await live("document.getElementById('outside').click()"); await sleep(1.4); await take("a dropped sound");

// Three by two, with words under each.
const sheet = await browser.newPage();
await sheet.setViewport({ width: 1200, height: 720 });
await sheet.setContent(`<style>body{margin:0;display:grid;grid-template-columns:repeat(3,1fr);gap:6px;padding:6px;font:15px sans-serif;background:#fff}
figure{margin:0}img{width:100%;display:block;border-radius:8px}figcaption{padding:4px 2px;color:#333}</style>${shots.map(({ words, image }) => `<figure><img src="${image}"><figcaption>${words}</figcaption></figure>`).join("")}`);
await sleep(1);
await sheet.screenshot({ path: picture, fullPage: true });
await browser.close();
console.log(`${picture}: ${(readFileSync(picture).length / 1e3).toFixed(0)} kB`);
