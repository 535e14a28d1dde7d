// A VRM 1.0 for tests and pictures: the stage's own person in other clothes, of another size, skinned, with expressions for blinks and the mouth.
import { readFileSync } from "node:fs";

const stage = new URL("../../tools/src/export/viewer/stage/", import.meta.url);
const code = ["math", "shapes", "mesh"].map((name) => readFileSync(new URL(`${name}.js`, stage), "utf8")).join("\n");
const { createShapes, bodyMesh, FACE_BONES, LIDS, TINT, mix } = new Function(`${code}\nreturn { createShapes, bodyMesh, FACE_BONES, LIDS, TINT, mix };`)();

const STRIDE = 36;
// Linear, as glTF has vertex colours: skin, hair, and so on by their tint; shirt, trousers, shoes.
const COLOURS = { [TINT.skin]: [0.40, 0.20, 0.12], [TINT.hair]: [0.011, 0.009, 0.008], [TINT.lips]: [0.33, 0.11, 0.09], [TINT.mouth]: [0.05, 0.01, 0.01] };
const CLOTHES = [[0.72, 0.29, 0.05], [0.06, 0.075, 0.05], [0.7, 0.68, 0.62]];

// `size`: of the body, against the rig's.
export function vrmOf({ joints, eyes, headBack }, size = 0.92) {
  const scaled = (p) => p.map((x) => x * size);
  const d = { joints: joints.map((j) => ({ ...j, offset: scaled(j.offset) })), eyes: scaled(eyes), headBack: scaled(headBack), rest: [], index: new Map(joints.map(({ name }, j) => [name, j])) };
  for (const { parent, offset } of d.joints) d.rest.push(parent === null ? [...offset] : offset.map((x, k) => x + d.rest[parent][k]));
  const shapes = createShapes(d), { data, indices } = bodyMesh(d, shapes), vertices = new DataView(data), count = data.byteLength / STRIDE;

  const bones = [...d.joints.map(({ name, parent }, j) => ({ name, at: d.rest[j], bound: shapes.bind.at[j], turn: shapes.bind.turn[j], parent })),
    ...FACE_BONES.map((name) => ({ name, at: shapes.pivots[name], bound: shapes.pivots[name], turn: 0, parent: d.index.get("head") }))];
  const colours = new Uint8Array(4 * count), morphs = { blink: new Float32Array(3 * count), aa: new Float32Array(3 * count) };
  const lowest = [Infinity, Infinity, Infinity], highest = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < count; i++) {
    const p = [0, 4, 8].map((o) => vertices.getFloat32(STRIDE * i + o, true)), at = (o) => vertices.getUint8(STRIDE * i + o);
    const bone = bones[at(24)];
    if (bone.name === "mouth") { // Modelled open.
      p[1] = mix(bone.at[1], p[1], 0.25);
      vertices.setFloat32(STRIDE * i + 4, p[1], true);
    }
    p.forEach((x, k) => { lowest[k] = Math.min(lowest[k], x); highest[k] = Math.max(highest[k], x); });
    colours.set([...colourOf(p, at(32), Math.hypot(at(34) / 127.5 - 1, at(35) / 127.5 - 1)).map((x) => Math.round(255 * x)), 255], 4 * i);
    if (/Lid$/.test(bone.name)) { // Turned down until it meets the lower lid.
      const [y, z] = [p[1] - bone.at[1], p[2] - bone.at[2]], a = ((LIDS.open - LIDS.lower) * Math.PI) / 180, [s, c] = [Math.sin(a), Math.cos(a)];
      morphs.blink.set([0, c * y - s * z - y, s * y + c * z - z], 3 * i);
    }
    if (bone.name === "lowerLip") morphs.aa.set([0, -0.011 * shapes.unit, 0], 3 * i);
    if (bone.name === "mouth") morphs.aa.set([0, 6 * (p[1] - bone.at[1]) - 0.005 * shapes.unit, 0], 3 * i);
  }
  function colourOf([x, y, z], tint, off) {
    if (tint === TINT.eye) return off < 0.2 ? [0, 0, 0] : off < 0.47 ? [0.06, 0.03, 0.015] : [0.8, 0.79, 0.78];
    if (tint !== TINT.body) return COLOURS[tint];
    const [soles, waist, collar] = shapes.cloth, [ax, ay, cuffs, least] = shapes.sleeve;
    if ((Math.abs(x) > least && Math.abs(x) * ax + y * ay > cuffs) || y > collar + 0.5 * Math.abs(x) - 0.3 * z) return COLOURS[TINT.skin];
    return CLOTHES[y > waist ? 0 : y > soles ? 1 : 2];
  }

  const parts = [], views = [];
  const view = (bytes, extra = {}) => { // Parts lie on multiples of four.
    views.push({ buffer: 0, byteOffset: parts.reduce((n, b) => n + b.length, 0), byteLength: bytes.byteLength, ...extra });
    parts.push(padded(Buffer.from(bytes.buffer ?? bytes, bytes.byteOffset ?? 0, bytes.byteLength), 0));
    return views.length - 1;
  };
  // Nodes rest in the T-pose that VRM asks for; the mesh is bound with its arms half lowered.
  const inverse = Float32Array.from(bones.flatMap(({ bound: [x, y, z], turn }) => {
    const [s, c] = [Math.sin(turn), Math.cos(turn)];
    return [c, -s, 0, 0, s, c, 0, 0, 0, 0, 1, 0, -c * x - s * y, s * x - c * y, -z, 1];
  }));
  const mesh = view(data, { byteStride: STRIDE, target: 34962 });
  const vec = (bufferView, byteOffset, componentType, type, extra = {}) => ({ bufferView, byteOffset, componentType, count, type, ...extra });
  const accessors = [
    vec(mesh, 0, 5126, "VEC3", { min: lowest, max: highest }), vec(mesh, 12, 5126, "VEC3"), vec(mesh, 24, 5121, "VEC4"), vec(mesh, 28, 5121, "VEC4", { normalized: true }),
    vec(view(colours, { target: 34962 }), 0, 5121, "VEC4", { normalized: true }),
    { ...vec(view(indices, { target: 34963 }), 0, 5125, "SCALAR"), count: indices.length }, { ...vec(view(inverse), 0, 5126, "MAT4"), count: bones.length },
    ...Object.values(morphs).map((m) => vec(view(m, { target: 34962 }), 0, 5126, "VEC3", { min: [-1, -1, -1], max: [1, 1, 1] })),
  ];
  const nodes = bones.map(({ name, at, parent }, j) => {
    const children = bones.flatMap((b, k) => (b.parent === j ? [k] : []));
    return { name, translation: parent === null ? at : at.map((x, k) => x - bones[parent].at[k]), ...(children.length ? { children } : {}) };
  });
  nodes.push({ name: "body", mesh: 0, skin: 0 });
  const hips = bones.findIndex(({ parent }) => parent === null), body = nodes.length - 1;
  const bind = (index) => ({ morphTargetBinds: [{ node: body, index, weight: 1 }] });
  const human = [...d.joints.map(({ name }, node) => [name, { node }]), ...["leftEye", "rightEye"].map((name) => [name, { node: bones.findIndex((b) => b.name === name) }])];
  const json = {
    asset: { version: "2.0" }, scene: 0, scenes: [{ nodes: [hips, body] }], nodes, skins: [{ joints: bones.map((_, j) => j), inverseBindMatrices: 6 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0, NORMAL: 1, JOINTS_0: 2, WEIGHTS_0: 3, COLOR_0: 4 }, indices: 5, material: 0, targets: [{ POSITION: 7 }, { POSITION: 8 }] }] }],
    materials: [{ pbrMetallicRoughness: { metallicFactor: 0, roughnessFactor: 0.85 } }],
    buffers: [{ byteLength: parts.reduce((n, b) => n + b.length, 0) }], bufferViews: views, accessors, extensionsUsed: ["VRMC_vrm"],
    extensions: { VRMC_vrm: {
      specVersion: "1.0", meta: { name: "Test body", authors: ["Visavis"], licenseUrl: "https://vrm.dev/licenses/1.0/" }, humanoid: { humanBones: Object.fromEntries(human) },
      expressions: { preset: { blink: bind(0), aa: bind(1) } },
      lookAt: { type: "bone", offsetFromHeadBone: scaled(eyes), ...Object.fromEntries(["HorizontalInner", "HorizontalOuter", "VerticalDown", "VerticalUp"].map((way) => [`rangeMap${way}`, { inputMaxValue: 40, outputScale: 40 }])) },
    } },
  };
  const chunk = (type, b) => { const head = Buffer.alloc(8); head.writeUInt32LE(b.length, 0); head.writeUInt32LE(type, 4); return Buffer.concat([head, b]); };
  const content = Buffer.concat([chunk(0x4e4f534a, padded(Buffer.from(JSON.stringify(json)), 32)), chunk(0x004e4942, Buffer.concat(parts))]);
  const head = Buffer.alloc(12);
  head.write("glTF", 0); head.writeUInt32LE(2, 4); head.writeUInt32LE(12 + content.length, 8);
  return Buffer.concat([head, content]);
}

const padded = (b, fill) => Buffer.concat([b, Buffer.alloc((4 - (b.length % 4)) % 4, fill)]);
