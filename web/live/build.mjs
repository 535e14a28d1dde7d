#!/usr/bin/env node
// usage: build.mjs [OUT]
// The live page in two forms: OUT/visavis.html (one file, works from disk) and OUT/site/ (for any static host); OUT is out/web and holds the
// npm package, which web/build.sh makes before it calls this. esbuild, three and @pixiv/three-vrm come from the npm registry, by web/live/package.json.
import { createHash } from "node:crypto";
import { execFileSync } from "node:child_process";
import { copyFileSync, mkdirSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";

const here = dirname(fileURLToPath(import.meta.url)), root = join(here, "../.."), out = resolve(process.argv[2] ?? join(root, "out/web"));
const configOf = (path) => {
  const bytes = readFileSync(path), header = bytes.subarray(8, 8 + Number(bytes.readBigUInt64LE()));
  return JSON.parse(JSON.parse(header.toString()).__metadata__.visavis);
};
// The agent's models, of which the first begins: VISAVIS_BUNDLES (paths, separated by spaces), else the quantised ones of models/ that stream, the default first.
const shipped = () => readdirSync(join(root, "models")).filter((name) => name.endsWith("-i8.safetensors")).map((name) => join(root, "models", name))
  .filter((path) => configOf(path).kind !== "mospa").sort((a, b) => b.includes("room") - a.includes("room"));
const bundles = process.env.VISAVIS_BUNDLES?.split(" ").filter(Boolean) ?? shipped();
const pack = join(out, "npm"), tools = join(out, "build"), modules = join(tools, "node_modules");
mkdirSync(tools, { recursive: true });
copyFileSync(join(here, "package.json"), join(tools, "package.json"));
execFileSync("npm", ["install", "--ignore-scripts", "--no-audit", "--no-fund", "--silent", "--prefix", tools], { stdio: "inherit" });
const esbuild = createRequire(join(tools, "package.json"))("esbuild");

// The stage is plain scripts that the recorded viewer joins by itself; here they are one module.
const stage = join(root, "tools/src/export/viewer/stage");
const parts = ["math", "shapes", "pose", "face", "mesh", "looks", "shaders", "lines", "webgl"];
const stageCode = `${parts.map((name) => readFileSync(join(stage, `${name}.js`), "utf8")).join("\n")}
export { createShapes, createPose, createFace, createWebgl, css, gazeColour, lookRotation, rotate, add, sub, scale, unit, length, mix, clamp, lookAt, multiply, perspective, sourceLines };`;

const plugin = {
  name: "visavis",
  setup(build) {
    build.onResolve({ filter: /^\.\/stage\.js$/ }, () => ({ path: "stage", namespace: "stage" }));
    build.onLoad({ filter: /.*/, namespace: "stage" }, () => ({ contents: stageCode, loader: "js" }));
    build.onResolve({ filter: /^visavis$/ }, () => ({ path: join(pack, "index.js") }));
  },
};
async function bundled(entry, options = {}) {
  const result = await esbuild.build({
    entryPoints: [entry.startsWith("/") ? entry : join(here, entry)], bundle: true, minify: true, write: false, format: "iife", target: "es2022", legalComments: "inline",
    charset: "utf8", nodePaths: [modules], plugins: [plugin], define: { "import.meta.url": "document.baseURI" }, logLevel: "warning", ...options,
  });
  return result.outputFiles[0].text;
}

// The agent's sentences of the sample conversation: cut where it is silent for 0.45 s.
function sentences() {
  const wav = readFileSync(join(root, "samples/agent.wav")), rate = wav.readUInt32LE(24), data = wav.indexOf("data") + 8;
  const pcm = new Int16Array(wav.buffer.slice(wav.byteOffset + data, wav.byteOffset + data + wav.readUInt32LE(data - 4)));
  const loud = (i) => { for (let k = i; k < Math.min(pcm.length, i + 160); k++) if (Math.abs(pcm[k]) > 250) return true; return false; };
  const pieces = [];
  for (let i = 0; i < pcm.length; i += 160) {
    if (!loud(i)) continue;
    const last = pieces[pieces.length - 1];
    if (last && i - last[1] < 0.45 * rate) last[1] = i + 160; else pieces.push([i, i + 160]);
  }
  const names = readFileSync(join(root, "samples/dialogue.tsv"), "utf8").split("\n").map((line) => line.split("\t")).filter(([who]) => who === "agent").map(([, , text]) => text);
  return { rate, names, pieces: pieces.map(([a, b]) => pcm.slice(Math.max(0, a - 800), Math.min(pcm.length, b + 1600))) };
}

// What its panel says of a bundle. All have the body that the page builds from the first.
function model(path) {
  const { name, kind = "sarah", rig, hearing } = configOf(path);
  if (JSON.stringify(rig) !== JSON.stringify(configOf(bundles[0]).rig)) throw new Error(`${path} has another rig than ${bundles[0]}: build a page of its own`);
  return { name, kind, hears: Boolean(hearing) };
}

const { rate, names, pieces } = sentences();
// One piece a sentence; where pauses cut more finely, neighbours are joined in the order of the dialogue.
const grouped = pieces.length === names.length ? pieces : null;
const short = (text) => (text.length > 26 ? `${text.slice(0, 24).replace(/[\s,.]+\S*$/, "")} …` : text);
const linesOf = grouped ? grouped.map((pcm, i) => ({ name: short(names[i]), pcm })) : pieces.map((pcm, i) => ({ name: `Line ${i + 1}`, pcm }));
const lines = { models: bundles.map(model), rate, names: linesOf.map((l) => l.name), lengths: linesOf.map((l) => l.pcm.length) };
const sound = Buffer.concat(linesOf.map(({ pcm }) => Buffer.from(pcm.buffer, pcm.byteOffset, pcm.byteLength)));

const html = readFileSync(join(here, "live.html"), "utf8"), style = readFileSync(join(here, "live.css"), "utf8");
const closed = (code) => code.replaceAll("</script", "<\\/script").replaceAll("<!--", "<\\!--");
const fill = (values) => html.replace(/\{\{(\w+)\}\}/g, (_, name) => values[name]);
const script = closed(await bundled("main.js"));
const avatars = await bundled("vrm.js", { globalName: "visavisAvatars" });
const packed = (bytes) => gzipSync(bytes, { level: 9 });
// Everything large, compressed; read by assets.js.
const large = {
  ...Object.fromEntries(bundles.map((path, i) => [`model${i}`, packed(readFileSync(path))])), sound: packed(sound), relaxed: packed(readFileSync(join(pack, "visavis-relaxed.wasm"))),
  simd128: packed(readFileSync(join(pack, "visavis-simd128.wasm"))), worker: packed(await bundled(join(pack, "worker.js"))),
};
const json = (id, value) => `<script type="application/json" id="${id}">${JSON.stringify(value).replaceAll("<", "\\u003c")}</script>`;
rmSync(join(out, "site"), { recursive: true, force: true });
mkdirSync(join(out, "site"), { recursive: true });

// One file: as base64 in elements.
const element = (id, bytes) => `<script type="application/octet-stream" id="${id}">${bytes.toString("base64")}</script>`;
const inside = Object.entries({ ...large, avatars: packed(avatars) }).map(([id, bytes]) => element(id, bytes));
writeFileSync(join(out, "visavis.html"), fill({ style, script, assets: [json("contents", lines), ...inside].join("\n") }));

// A folder: beside the page, under names that change with what they hold.
const named = (stem, end, bytes) => {
  const file = `${stem}-${createHash("sha256").update(bytes).digest("hex").slice(0, 10)}.${end}`;
  writeFileSync(join(out, "site", file), bytes);
  return file;
};
const files = Object.fromEntries(Object.entries(large).map(([id, bytes]) => [id, named(id, "gz", bytes)]));
files.avatars = named("avatars", "js", avatars);
const live = named("live", "js", script), sizes = Object.fromEntries(bundles.map((_, i) => [`model${i}`, large[`model${i}`].length]));
const site = fill({ style, script: "", assets: json("files", { ...files, sizes, contents: lines }) })
  .replace("<script>\n\n</script>", `<script src="${live}"></script>`).replace('<html lang="en"', '<html lang="en" data-worker="worker.js"');
writeFileSync(join(out, "site/index.html"), site);
const version = createHash("sha256").update(site).digest("hex").slice(0, 12);
const cached = JSON.stringify(["./", live, ...Object.values(files)]);
writeFileSync(join(out, "site/worker.js"), readFileSync(join(here, "offline.js"), "utf8").replace("{{version}}", version).replace('"{{files}}"', cached));
const megabytes = (file) => `${(readFileSync(file).length / 1e6).toFixed(1)} MB`;
console.log(`${join(out, "visavis.html")}: ${megabytes(join(out, "visavis.html"))}`);
console.log(`${join(out, "site")}/: models ${lines.models.map(({ name }, i) => `${name} ${(large[`model${i}`].length / 1e6).toFixed(1)} MB`).join(", ")}, page ${(script.length / 1e3).toFixed(0)} kB, avatars ${(avatars.length / 1e3).toFixed(0)} kB`);
