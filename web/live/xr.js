// Standing in front of the agent: WebXR, immersive VR and AR.
//
// The headset's floor is laid into the agent's world so that the user stands 1.5 m in front of the agent, where the agent faces at that
// moment, looking at it: anew for each session, and whenever the headset is recentred. A fixed place would bring who has walked around
// before, or changes from VR to AR, in behind the agent's back, which then takes two seconds to turn.
import { multiply } from "./stage.js";

const AWAY = 1.5;

export function createXr(gl, { agentRoot, frame, onHead, onGaze, onInterrupt, onChange }) {
  // `first`: where both stood in the first picture after the user was placed.
  const xr = { mode: null, first: null, offers: { vr: false, ar: false } };
  let session = null, floor = null, lie = null;

  xr.look = async () => {
    const can = (mode) => navigator.xr?.isSessionSupported(mode).catch(() => false) ?? false;
    [xr.offers.vr, xr.offers.ar] = await Promise.all([can("immersive-vr"), can("immersive-ar")]);
    return xr.offers;
  };

  // "vr", "ar", or null to leave. From one to the other the first ends before the second begins.
  xr.enter = async (mode) => {
    if (session) await session.end();
    if (!mode) return;
    // Asked for first: a browser grants it only in a gesture of the user.
    const next = await navigator.xr.requestSession(mode === "vr" ? "immersive-vr" : "immersive-ar", { requiredFeatures: ["local-floor"] });
    session = next;
    session.addEventListener("end", ended);
    session.addEventListener("select", onInterrupt);
    session.addEventListener("squeeze", () => onGaze(null));
    await gl.makeXRCompatible();
    session.updateRenderState({ baseLayer: new XRWebGLLayer(session, gl), depthNear: 0.05, depthFar: 80 });
    floor = await session.requestReferenceSpace("local-floor");
    floor.addEventListener?.("reset", () => { lie = null; });
    lie = null;
    xr.mode = mode;
    onChange();
    session.requestAnimationFrame(draw);
  };

  function ended() {
    session = null;
    xr.mode = null;
    onChange();
  }

  // The user's place on the headset's floor becomes the place before the agent, its looking ahead the way to the agent.
  function lay(pose) {
    const { x, z, yaw } = agentRoot();
    const { position: p, orientation: q } = pose.transform;
    const heading = Math.atan2(-2 * (q.x * q.z + q.w * q.y), -(1 - 2 * (q.x * q.x + q.y * q.y)));
    // Turned by `turn` about the vertical, `heading` becomes the agent's yaw and half a turn.
    const turn = yaw + Math.PI - heading, [s, c] = [Math.sin(turn), Math.cos(turn)];
    const [wx, wz] = [x + AWAY * Math.sin(yaw), z + AWAY * Math.cos(yaw)];
    const [ox, oz] = [wx - (c * p.x + s * p.z), wz - (c * p.z - s * p.x)];
    xr.first = null;
    lie = {
      // A point of the headset's floor in the world, and the world's matrix in the headset's.
      turn: [0, Math.sin(turn / 2), 0, Math.cos(turn / 2)],
      at: ({ x: a, y: b, z: d }) => [ox + c * a + s * d, b, oz - s * a + c * d],
      back: [c, 0, s, 0, 0, 1, 0, 0, -s, 0, c, 0, s * oz - c * ox, 0, -s * ox - c * oz, 1],
    };
  }

  function draw(time, xrFrame) {
    if (xrFrame.session !== session) return;
    session.requestAnimationFrame(draw);
    const pose = xrFrame.getViewerPose(floor);
    if (!pose) return;
    if (!lie) lay(pose);
    const head = lie.at(pose.transform.position), layer = session.renderState.baseLayer;
    xr.first ??= { user: head, agent: { ...agentRoot() } };
    // A headset that is not turned looks along -Z, ours along +Z: half a turn first.
    const { x, y, z, w } = pose.transform.orientation;
    onHead(head, turned(lie.turn, turned([x, y, z, w], [0, 1, 0, 0])));
    sticks();
    const views = pose.views.map((view) => {
      const camera = multiply(view.transform.inverse.matrix, lie.back);
      return {
        eye: lie.at(view.transform.position), viewport: layer.getViewport(view),
        projection: view.projectionMatrix, camera, matrix: multiply(view.projectionMatrix, camera),
      };
    });
    frame(time, views, layer.framebuffer, session.environmentBlendMode !== "opaque" || xr.mode === "ar");
  }

  // One quaternion after another: first b, then a.
  function turned([x, y, z, w], [a, b, c, d]) {
    return [w * a + x * d + y * c - z * b, w * b - x * c + y * d + z * a, w * c + x * b - y * a + z * d, w * d - x * a - y * b - z * c];
  }

  // A stick pushed up or down raises or lowers the gaze target.
  function sticks() {
    for (const { gamepad } of session.inputSources) {
      const push = gamepad?.axes?.[3] ?? 0;
      if (Math.abs(push) > 0.25) onGaze(-push * 0.008);
    }
  }
  return xr;
}
