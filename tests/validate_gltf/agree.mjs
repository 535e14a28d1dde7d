// Plays the same motion from several formats in three.js and compares where the joints are.
import { AnimationMixer, Vector3 } from 'three';
import { BVHLoader } from 'three/addons/loaders/BVHLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

async function open(name, bytes) {
  if (name.endsWith('.bvh')) {
    const { skeleton, clip } = new BVHLoader().parse(new TextDecoder().decode(bytes));
    return { root: skeleton.bones[0], clip, unit: 0.01 };
  }
  const gltf = await new GLTFLoader().parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength), '');
  return { root: gltf.scene, clip: gltf.animations[0], unit: 1 };
}

// World positions (metres) of the joints at frame i.
function positions({ root, clip, unit }, joints, frame) {
  const mixer = new AnimationMixer(root);
  mixer.clipAction(clip).play();
  mixer.setTime(frame / 30);
  root.updateMatrixWorld(true);
  return joints.map((name) => root.getObjectByName(name)?.getWorldPosition(new Vector3()).multiplyScalar(unit));
}

// Problems, and the largest distance found, for [[name, bytes], ...] of the same motion.
export async function agree(files) {
  const opened = [];
  // Only BVH says which nodes are joints, so it comes first.
  const order = [...files].sort(([a], [b]) => b.endsWith('.bvh') - a.endsWith('.bvh'));
  for (const [name, bytes] of order) opened.push({ name, ...(await open(name, bytes)) });
  const [first, ...others] = opened;
  const joints = [];
  first.root.traverse((o) => o.isBone && o.name !== 'ENDSITE' && joints.push(o.name));
  const frames = Math.round(first.clip.duration * 30);
  const problems = joints.length < 15 ? [`only ${joints.length} joints in ${first.name}`] : [];
  let worst = 0;
  for (const share of [0, 0.2, 0.5, 0.8]) {
    const frame = Math.floor(frames * share);
    const expected = positions(first, joints, frame);
    for (const other of others) {
      positions(other, joints, frame).forEach((p, i) => {
        const off = p ? p.distanceTo(expected[i]) : Infinity;
        worst = Math.max(worst, off);
        if (!(off < 0.001)) problems.push(`${joints[i]} at frame ${frame}: ${first.name} and ${other.name} differ by ${off} m`);
      });
    }
  }
  return { problems, note: `${joints.length} joints, within ${(worst * 1000).toFixed(4)} mm` };
}
