// A minimal VRM 1.0 for tests: a box on each joint of a rig, skinned by nothing, the humanoid complete.
export function vrmOf({ joints }) {
  // A box of 24 vertices around the origin, 8 cm wide.
  const corners = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]].flatMap((n) => {
    const u = [n[1], n[2], n[0]], v = [n[2], n[0], n[1]].map((x) => x * (n[0] + n[1] + n[2]));
    return [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => ({ n, p: n.map((x, k) => 0.04 * (x + a * u[k] + b * v[k])) }));
  });
  const points = Float32Array.from(corners.flatMap(({ p }) => p)), normals = Float32Array.from(corners.flatMap(({ n }) => n));
  const faces = Uint16Array.from([0, 1, 2, 3, 4, 5].flatMap((f) => [0, 1, 2, 0, 2, 3].map((k) => 4 * f + k)));
  const bin = Buffer.concat([points, normals, faces].map((a) => Buffer.from(a.buffer)));
  const nodes = joints.map(({ name, offset }, j) => {
    const children = joints.flatMap((c, k) => (c.parent === j ? [k] : []));
    return { name, translation: offset, mesh: 0, ...(children.length ? { children } : {}) };
  });
  const humanBones = Object.fromEntries(joints.map(({ name }, node) => [name, { node }]));
  const view = (byteOffset, byteLength, target) => ({ buffer: 0, byteOffset, byteLength, target });
  const json = {
    asset: { version: "2.0" }, scene: 0, scenes: [{ nodes: [joints.findIndex(({ parent }) => parent === null)] }], nodes,
    meshes: [{ primitives: [{ attributes: { POSITION: 0, NORMAL: 1 }, indices: 2, material: 0 }] }],
    materials: [{ pbrMetallicRoughness: { baseColorFactor: [0.85, 0.45, 0.2, 1], metallicFactor: 0, roughnessFactor: 0.8 } }],
    buffers: [{ byteLength: bin.length }], bufferViews: [view(0, points.byteLength, 34962), view(points.byteLength, normals.byteLength, 34962), view(points.byteLength + normals.byteLength, faces.byteLength, 34963)],
    accessors: [
      { bufferView: 0, componentType: 5126, count: 24, type: "VEC3", min: [-0.08, -0.08, -0.08], max: [0.08, 0.08, 0.08] },
      { bufferView: 1, componentType: 5126, count: 24, type: "VEC3" }, { bufferView: 2, componentType: 5123, count: 36, type: "SCALAR" },
    ],
    extensionsUsed: ["VRMC_vrm"],
    extensions: { VRMC_vrm: { specVersion: "1.0", meta: { name: "Test body", authors: ["Visavis"], licenseUrl: "https://vrm.dev/licenses/1.0/" }, humanoid: { humanBones } } },
  };
  const pad = (b, fill) => Buffer.concat([b, Buffer.alloc((4 - (b.length % 4)) % 4, fill)]);
  const chunk = (type, b) => { const head = Buffer.alloc(8); head.writeUInt32LE(b.length, 0); head.writeUInt32LE(type, 4); return Buffer.concat([head, b]); };
  const body = Buffer.concat([chunk(0x4e4f534a, pad(Buffer.from(JSON.stringify(json)), 32)), chunk(0x004e4942, pad(bin, 0))]);
  const head = Buffer.alloc(12);
  head.write("glTF", 0); head.writeUInt32LE(2, 4); head.writeUInt32LE(12 + body.length, 8);
  return Buffer.concat([head, body]);
}
