#!/usr/bin/env node
// usage: stage.mjs BUNDLE.safetensors OUT
// What the demo's stage is drawn from: the viewer's own body, made by its own scripts for the rig of a bundle, with its shaders and colours.
// Little-endian, in the order of StageData.java.
import { readFileSync, writeFileSync, openSync, readSync } from "node:fs";
import { runInNewContext } from "node:vm";

const [bundle, out] = process.argv.slice(2);
const page = new URL("../../tools/src/export/viewer/stage/", import.meta.url);
const names = "createShapes, headsetShapes, bodyMesh, headsetMesh, BODY_VERTEX, BODY_FRAGMENT, FLOOR_VERTEX, FLOOR_FRAGMENT, LINE_VERTEX, LINE_FRAGMENT, LOOKS, CAPSULES, add";
const scripts = ["math.js", "shapes.js", "mesh.js", "looks.js", "shaders.js"].map((name) => readFileSync(new URL(name, page), "utf8"));
const viewer = runInNewContext(`${scripts.join("\n")}\n({ ${names} })`, { console });

const file = openSync(bundle, "r");
const size = Buffer.alloc(8);
readSync(file, size, 0, 8, 0);
const header = Buffer.alloc(Number(size.readBigUInt64LE()));
readSync(file, header, 0, header.length, 8);
const { rig } = JSON.parse(JSON.parse(header.toString()).__metadata__.visavis);

const d = { joints: rig.joints, eyes: rig.eyes, headBack: rig.head_back, index: new Map(rig.joints.map((joint, j) => [joint.name, j])), rest: [] };
for (const joint of d.joints) d.rest.push(joint.parent === null ? joint.offset : viewer.add(d.rest[joint.parent], joint.offset));
const shapes = viewer.createShapes(d);
const look = viewer.LOOKS.dark;

const parts = [];
const ints = (...values) => { const b = Buffer.alloc(4 * values.length); values.forEach((v, i) => b.writeInt32LE(v, 4 * i)); parts.push(b); };
const floats = (values) => { const b = Buffer.alloc(4 * values.length); [...values].forEach((v, i) => b.writeFloatLE(v, 4 * i)); parts.push(b); };
const text = (value) => { const b = Buffer.from(value); ints(b.length); parts.push(b); };
// The app's face rests: what face.js would move rides on the head.
const rest = (data) => {
  const bytes = new Uint8Array(data), head = d.index.get("head") ?? 0;
  for (let v = 0; v < bytes.length; v += 36) for (let k = 24; k < 28; k++) if (bytes[v + k] >= d.joints.length) bytes[v + k] = head;
};
const mesh = ({ data, indices }) => {
  rest(data);
  ints(data.byteLength / 36, indices.length);
  parts.push(Buffer.from(data), Buffer.from(Uint8Array.from(new Uint8Array(indices.buffer))));
};

ints(0x47545356, d.joints.length); // "VSTG"
floats([...d.eyes, ...d.headBack, ...shapes.bind.turn, ...shapes.cloth, ...shapes.sleeve, ...look.floor, ...look.grid, look.dark, look.shade, ...look.tints.flat(), ...look.clothes.flat()]);
const capsules = shapes.all.filter((s) => s.core || s.shade).slice(0, viewer.CAPSULES - 1);
ints(viewer.CAPSULES, capsules.length);
for (const s of capsules) {
  ints(s.bone);
  floats([...s.a, ...s.b, (0.5 * (s.ra + s.rb)) / Math.max(1, s.s[2] ** 0.5)]);
}
for (const shader of [viewer.BODY_VERTEX(d.joints.length), viewer.BODY_FRAGMENT, viewer.FLOOR_VERTEX, viewer.FLOOR_FRAGMENT, viewer.LINE_VERTEX, viewer.LINE_FRAGMENT]) text(shader);
mesh(viewer.bodyMesh(d, shapes));
mesh(viewer.headsetMesh());
writeFileSync(out, Buffer.concat(parts));
