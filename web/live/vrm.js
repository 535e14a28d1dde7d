// A VRM avatar in place of the stage's own body: three.js draws it into the same context, after the stage, with the same matrices.
// Loaded only when an avatar is dropped.
import { Camera, DirectionalLight, HemisphereLight, Matrix4, Scene, Vector3, WebGLRenderTarget, WebGLRenderer } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { VRMLoaderPlugin, VRMUtils } from "@pixiv/three-vrm";

export async function createAvatar(bytes, { canvas, gl, rig }) {
  const loader = new GLTFLoader();
  loader.register((parser) => new VRMLoaderPlugin(parser));
  const gltf = await loader.parseAsync(bytes, "");
  const vrm = gltf.userData.vrm;
  if (!vrm) throw new Error("the file is a glTF without a VRM humanoid; export it as VRM 0 or 1");
  VRMUtils.rotateVRM0(vrm);
  const bones = rig.joints.map(({ name }) => vrm.humanoid.getNormalizedBoneNode(name));
  const hips = bones[rig.joints.findIndex(({ parent }) => parent === null)];
  if (!hips) throw new Error("its humanoid has no hips");
  const tall = hips.position.y / rig.joints[0].offset[1];

  const renderer = new WebGLRenderer({ canvas, context: gl, antialias: true, alpha: true });
  renderer.autoClear = false;
  renderer.xr.enabled = false;
  const scene = new Scene(), camera = new Camera(), target = new WebGLRenderTarget(1, 1);
  camera.matrixAutoUpdate = camera.matrixWorldAutoUpdate = false;
  const key = new DirectionalLight(0xfff2e2, 2.0);
  key.position.set(0.41, 0.8, 0.44);
  scene.add(vrm.scene, key, new HemisphereLight(0xe4ebff, 0x8a837c, 1.6));
  vrm.scene.traverse((node) => { node.frustumCulled = false; });
  const flipped = vrm.meta?.metaVersion === "0" ? -1 : 1;
  const place = new Vector3();

  return {
    name: vrm.meta?.name ?? vrm.meta?.title ?? "a VRM avatar",
    bones: bones.filter(Boolean).length,
    // Local rotations of the rig's joints are those of the humanoid's normalised bones.
    pose(pose, local, face, seconds) {
      bones.forEach((bone, j) => {
        const [x, y, z, w] = local.subarray(4 * j, 4 * j + 4);
        bone?.quaternion.set(flipped * x, y, flipped * z, w).normalize();
      });
      const at = pose.position[0];
      // Its own height; on the floor where the agent is.
      place.set(pose.root[0] + (at[0] - pose.root[0]) * tall, at[1] * tall, pose.root[2] + (at[2] - pose.root[2]) * tall);
      hips.position.set(flipped * place.x, place.y, flipped * place.z);
      vrm.expressionManager?.setValue("blink", face.blink);
      vrm.expressionManager?.setValue("aa", 0.9 * face.open);
      if (vrm.lookAt) [vrm.lookAt.yaw, vrm.lookAt.pitch] = [(face.yaw * 180) / Math.PI, (face.pitch * 180) / Math.PI];
      vrm.update(Math.min(0.1, Math.max(0, seconds)));
    },
    draw(views, framebuffer) {
      renderer.resetState();
      if (framebuffer) {
        renderer.setRenderTargetFramebuffer(target, framebuffer);
        renderer.setRenderTarget(target);
      } else {
        renderer.setRenderTarget(null);
      }
      for (const view of views) {
        const { x, y, width, height } = view.viewport ?? { x: 0, y: 0, width: canvas.width, height: canvas.height };
        if (framebuffer) target.viewport.set(x, y, width, height);
        else renderer.setViewport(x, y, width, height);
        if (framebuffer) renderer.setRenderTarget(target);
        camera.projectionMatrix.fromArray(view.projection);
        camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
        camera.matrixWorldInverse.fromArray(view.camera);
        camera.matrixWorld.copy(new Matrix4().fromArray(view.camera).invert());
        renderer.render(scene, camera);
      }
      renderer.resetState();
    },
    dispose() { VRMUtils.deepDispose(vrm.scene); target.dispose(); },
  };
}
