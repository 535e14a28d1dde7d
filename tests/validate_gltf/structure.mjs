// Checks of what the glTF validator does not know: the VRMC_vrm_animation 1.0 extension, and what we promise of a .glb.

// VRM 1.0 humanoid: bone -> [parent, required]. Eyes, jaw and fingers are not exported.
const BONES = {
  hips: [null, true], spine: ['hips', true], chest: ['spine', false], upperChest: ['chest', false], neck: ['upperChest', false], head: ['neck', true],
};
for (const side of ['left', 'right']) {
  const chain = (parent, bones) => {
    for (const [bone, required] of bones) {
      BONES[side + bone] = [parent, required];
      parent = side + bone;
    }
  };
  chain('upperChest', [['Shoulder', false], ['UpperArm', true], ['LowerArm', true], ['Hand', true]]);
  chain('hips', [['UpperLeg', true], ['LowerLeg', true], ['Foot', true], ['Toes', false]]);
}

export function parse(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const length = view.getUint32(12, true);
  return JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + length)));
}

// The paths of each node that an animation moves.
function targets(gltf) {
  const moved = new Map();
  for (const channel of (gltf.animations ?? []).flatMap((a) => a.channels)) {
    const { node, path } = channel.target;
    moved.set(node, [...(moved.get(node) ?? []), path]);
  }
  return moved;
}

export function checkGlb(bytes) {
  const gltf = parse(bytes);
  const problems = [];
  if (gltf.animations?.length !== 1) problems.push('there is not exactly one animation');
  if (gltf.skins?.length !== 1) problems.push('there is not exactly one skin');
  const moved = targets(gltf);
  for (const node of gltf.skins?.[0]?.joints ?? []) {
    if (!moved.get(node)?.includes('rotation')) problems.push(`joint ${gltf.nodes[node].name} is not animated`);
  }
  return problems;
}

export function checkVrma(bytes) {
  const gltf = parse(bytes);
  const name = 'VRMC_vrm_animation';
  const extension = gltf.extensions?.[name];
  if (!extension) return [`no extension ${name}`];
  const problems = [];
  if (!gltf.extensionsUsed?.includes(name)) problems.push(`extensionsUsed does not name ${name}`);
  if (extension.specVersion !== '1.0') problems.push(`specVersion is ${extension.specVersion}, not 1.0`);
  for (const key of Object.keys(extension)) {
    if (!['specVersion', 'humanoid', 'expressions', 'lookAt', 'extensions', 'extras'].includes(key)) problems.push(`unknown property ${key}`);
  }
  const bones = extension.humanoid?.humanBones;
  if (!bones) return [...problems, 'no humanoid.humanBones'];
  const parent = [];
  gltf.nodes.forEach((node, i) => (node.children ?? []).forEach((c) => (parent[c] = i)));
  const boneOf = new Map(Object.entries(bones).map(([bone, { node }]) => [node, bone]));
  if (boneOf.size !== Object.keys(bones).length) problems.push('two bones share a node');
  const above = (node) => {
    for (let p = parent[node]; p !== undefined; p = parent[p]) if (boneOf.has(p)) return boneOf.get(p);
    return null;
  };
  const moved = targets(gltf);
  for (const [bone, { node, ...rest }] of Object.entries(bones)) {
    if (!BONES[bone]) problems.push(`${bone} is not a bone of the humanoid body`);
    if (!gltf.nodes[node]) problems.push(`${bone} is node ${node}, which does not exist`);
    if (Object.keys(rest).some((k) => k !== 'extensions' && k !== 'extras')) problems.push(`${bone} has unknown properties`);
    const paths = moved.get(node) ?? [];
    if (paths.includes('scale')) problems.push(`${bone} is scaled`);
    if (paths.includes('translation') && bone !== 'hips') problems.push(`${bone} is translated; only the hips may be`);
  }
  for (const [bone, [parentBone, required]] of Object.entries(BONES)) {
    if (!bones[bone]) {
      if (required) problems.push(`required bone ${bone} is missing`);
      continue;
    }
    let expected = parentBone;
    while (expected && !bones[expected]) expected = BONES[expected][0];
    const actual = above(bones[bone].node);
    if (actual !== expected) problems.push(`${bone} hangs on ${actual}, not on ${expected}`);
  }
  if (bones.upperChest && !bones.chest) problems.push('upperChest without chest');
  return [...problems, ...checkRest(gltf, bones)];
}

// The rest pose is a T-pose that faces +Z: no rotation or scale at rest, left on +X, arms level, feet below.
function checkRest(gltf, bones) {
  const problems = [];
  const world = (node) => {
    const p = [0, 0, 0];
    const parentOf = (n) => gltf.nodes.findIndex((other) => other.children?.includes(n));
    for (let n = node; n >= 0; n = parentOf(n)) (gltf.nodes[n].translation ?? [0, 0, 0]).forEach((v, i) => (p[i] += v));
    return p;
  };
  for (const node of gltf.nodes) {
    if (node.rotation || node.scale || node.matrix) problems.push(`${node.name} is rotated or scaled at rest`);
  }
  const at = Object.fromEntries(Object.entries(bones).map(([bone, { node }]) => [bone, world(node)]));
  if (!at.leftHand || !at.rightHand || !at.leftFoot || !at.head) return problems;
  if (at.leftHand[0] < 0.4 || at.rightHand[0] > -0.4) problems.push('the left hand is not on +X, or the right not on -X');
  if (Math.abs(at.leftHand[1] - at.leftUpperArm[1]) > 0.1) problems.push('the arms are not level at rest');
  if (at.leftFoot[1] < -0.02 || at.leftFoot[1] > 0.2 || at.head[1] < 1) problems.push('it does not stand on the floor at rest');
  if (at.leftToes && at.leftToes[2] < at.leftFoot[2] + 0.03) problems.push('the toes do not point to +Z at rest');
  return problems;
}
