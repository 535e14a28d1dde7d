#!/usr/bin/env node
// usage: page.mjs PACKAGE_FOLDER OUT [BUNDLE.safetensors]
// The live page in two forms: OUT/visavis.html (one file, works from disk) and OUT/site/ (any static host). Called by web/build.sh.
// PACKAGE_FOLDER is the npm package `visavis`; esbuild, three and @pixiv/three-vrm come from NODE_PATH or web/node_modules.
import { createHash } from "node:crypto";
import { cpSync, mkdirSync, readFileSync, rmSync, writeFileSync, existsSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";

const here = dirname(fileURLToPath(import.meta.url)), root = join(here, "..");
const [pack, out, bundle = join(root, "models/visavis-base-i8.safetensors")] = process.argv.slice(2).map((p) => resolve(p));
if (!out) { console.error("usage: page.mjs PACKAGE_FOLDER OUT [BUNDLE.safetensors]"); process.exit(2); }
const modules = process.env.NODE_PATH ?? join(here, "node_modules");
const esbuild = createRequire(join(modules, "x.js"))("esbuild");

// The stage is plain scripts that the recorded viewer joins by itself; here they are one module.
const stage = join(root, "tools/src/export/viewer/stage");
const parts = ["math", "shapes", "pose", "face", "mesh", "looks", "shaders", "lines", "webgl"];
const stageCode = `${parts.map((name) => readFileSync(join(stage, `${name}.js`), "utf8")).join("\n")}
export { createShapes, createPose, createFace, createWebgl, css, gazeColour, add, sub, scale, unit, length, mix, clamp, lookAt, multiply, perspective };`;

const plugin = {
  name: "visavis",
  setup(build) {
    build.onResolve({ filter: /^\.\/stage\.js$/ }, () => ({ path: "stage", namespace: "stage" }));
    build.onLoad({ filter: /.*/, namespace: "stage" }, () => ({ contents: stageCode, loader: "js" }));
    build.onResolve({ filter: /^visavis$/ }, () => ({ path: join(pack, JSON.parse(readFileSync(join(pack, "package.json"), "utf8")).main ?? "index.js") }));
  },
};
async function bundled(entry, options = {}) {
  const result = await esbuild.build({
    entryPoints: [join(here, "live", entry)], bundle: true, minify: true, write: false, format: "iife", target: "es2022", legalComments: "inline",
    charset: "utf8", nodePaths: [modules], plugins: [plugin], loader: { ".wasm": "binary" }, logLevel: "warning", ...options,
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

const { rate, names, pieces } = sentences();
// One piece a sentence; where pauses cut more finely, neighbours are joined in the order of the dialogue.
const grouped = pieces.length === names.length ? pieces : null;
const short = (text) => (text.length > 26 ? `${text.slice(0, 24).replace(/[\s,.]+\S*$/, "")} …` : text);
const linesOf = grouped ? grouped.map((pcm, i) => ({ name: short(names[i]), pcm })) : pieces.map((pcm, i) => ({ name: `Line ${i + 1}`, pcm }));
const lines = { rate, names: linesOf.map((l) => l.name), lengths: linesOf.map((l) => l.pcm.length) };
const sound = Buffer.concat(linesOf.map(({ pcm }) => Buffer.from(pcm.buffer, pcm.byteOffset, pcm.byteLength)));

const html = readFileSync(join(here, "live/live.html"), "utf8"), style = readFileSync(join(here, "live/live.css"), "utf8");
const closed = (code) => code.replaceAll("</script", "<\\/script").replaceAll("<!--", "<\\!--");
const fill = (values) => html.replace(/\{\{(\w+)\}\}/g, (_, name) => values[name]);
const script = closed(await bundled("main.js"));
const avatars = await bundled("vrm.js", { globalName: "visavisAvatars" });
const weights = gzipSync(readFileSync(bundle), { level: 9 });
rmSync(join(out, "site"), { recursive: true, force: true });
mkdirSync(join(out, "site"), { recursive: true });

// One file: everything inside, as base64 of gzip.
const element = (id, bytes, extra = "") => `<script type="application/octet-stream" id="${id}"${extra}>${bytes.toString("base64")}</script>`;
const facts = `<script type="application/json" id="lines">${JSON.stringify(lines).replaceAll("<", "\\u003c")}</script>`;
writeFileSync(join(out, "visavis.html"), fill({
  style, script, assets: [facts, element("sound", gzipSync(sound, { level: 9 })), element("avatars", gzipSync(Buffer.from(avatars), { level: 9 })), element("bundle", weights)].join("\n"),
}));

// A folder: large things beside the page, under names that change with them.
const named = (name, bytes) => {
  const [stem, end] = name.split(/\.(.*)/s), file = `${stem}-${createHash("sha256").update(bytes).digest("hex").slice(0, 10)}.${end}`;
  writeFileSync(join(out, "site", file), bytes);
  return file;
};
const files = { bundle: named("bundle.gz", weights), sound: named("sound.gz", gzipSync(sound, { level: 9 })), avatars: named("avatars.js", Buffer.from(avatars)), script: named("live.js", Buffer.from(script)) };
const sizes = { bundle: weights.length };
const site = fill({ style, script: "", assets: `<script type="application/json" id="files">${JSON.stringify({ ...files, sizes, lines }).replaceAll("<", "\\u003c")}</script>` })
  .replace("<script>\n\n</script>", `<script src="${files.script}"></script>`).replace('<html lang="en"', '<html lang="en" data-worker="worker.js"');
writeFileSync(join(out, "site/index.html"), site);
const version = createHash("sha256").update(site).digest("hex").slice(0, 12);
writeFileSync(join(out, "site/worker.js"), readFileSync(join(here, "live/offline.js"), "utf8").replace("{{version}}", version).replace('"{{files}}"', JSON.stringify(["./", ...Object.values(files)])));
for (const extra of ["THIRD-PARTY.txt"]) if (existsSync(join(here, "live", extra))) cpSync(join(here, "live", extra), join(out, "site", extra));
console.log(`${join(out, "visavis.html")}: ${(readFileSync(join(out, "visavis.html")).length / 1e6).toFixed(1)} MB; ${join(out, "site")}/`);
