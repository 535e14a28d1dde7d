// Loads a file with the three.js loaders, without a browser.
import { AnimationMixer, Box3, Vector3 } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { VRMAnimationLoaderPlugin } from '@pixiv/three-vrm-animation';

export async function load(bytes, vrma) {
  const loader = new GLTFLoader();
  if (vrma) loader.register((parser) => new VRMAnimationLoaderPlugin(parser));
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
  const gltf = await loader.parseAsync(buffer, '');
  return vrma ? checkVrmAnimation(gltf) : checkScene(gltf);
}

function checkVrmAnimation(gltf) {
  const [animation] = gltf.userData.vrmAnimations ?? [];
  if (!animation) return { problems: ['no VRM animation was loaded'] };
  const { duration, restHipsPosition, humanoidTracks } = animation;
  const problems = [];
  const tracks = [...humanoidTracks.rotation.values(), ...humanoidTracks.translation.values()];
  if (tracks.some((t) => !t.values.every(Number.isFinite))) problems.push('a track is not finite');
  if (humanoidTracks.rotation.size < 15) problems.push(`only ${humanoidTracks.rotation.size} bones are rotated`);
  if (humanoidTracks.translation.size !== 1 || !humanoidTracks.translation.has('hips')) problems.push('the hips are not the one translated bone');
  if (!(restHipsPosition.y > 0.3 && restHipsPosition.y < 2)) problems.push(`the hips rest at ${restHipsPosition.toArray()}`);
  return { problems, note: `${humanoidTracks.rotation.size} rotation tracks, ${duration.toFixed(2)} s` };
}

// The skinned vertices, moved by the animation as a viewer does it, stay around the hips.
function checkScene(gltf) {
  const [clip] = gltf.animations;
  if (!clip) return { problems: ['no animation was loaded'] };
  const mixer = new AnimationMixer(gltf.scene);
  mixer.clipAction(clip).play();
  const hips = gltf.scene.getObjectByName('hips');
  const problems = [];
  let tallest = 0;
  for (const share of [0, 0.5, 0.99]) {
    mixer.setTime(clip.duration * share);
    gltf.scene.updateMatrixWorld(true);
    const box = new Box3();
    gltf.scene.traverse((mesh) => {
      if (!mesh.isSkinnedMesh) return;
      mesh.skeleton.update();
      mesh.computeBoundingBox();
      box.union(mesh.boundingBox);
    });
    const size = box.getSize(new Vector3());
    tallest = Math.max(tallest, size.y);
    const middle = hips.getWorldPosition(new Vector3());
    if (!(size.y > 0.5 && size.y < 3 && size.x < 3 && size.z < 3)) problems.push(`at ${share}: the body measures ${size.toArray()}`);
    if (!box.containsPoint(middle)) problems.push(`at ${share}: the hips are outside the body`);
  }
  return { problems, note: `${clip.duration.toFixed(2)} s, ${tallest.toFixed(2)} m tall` };
}
