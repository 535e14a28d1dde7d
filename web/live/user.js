// Where the user is: eyes 1.65 m above the floor, walking with keys, fingers, a gamepad, or a headset. Looks at the agent.
import { add, clamp, length, lookAt, lookRotation, mix, multiply, perspective, scale, sub } from "./stage.js";

const HEIGHT = 1.65;
const SPEED = { walk: 1.3, turn: 1.0 };

export function createUser(canvas) {
  const user = { position: [0, HEIGHT, 2.1], rotation: [0, 1, 0, 0], inHeadset: false, outside: false, orbit: { yaw: 0.7, pitch: 0.2, distance: 4.6 }, moved: 0 };
  const held = new Set(), pointers = new Map();
  let focus = [0, 1.2, 0];

  // Round the agent by an angle, towards it by metres; never nearer than 0.45 m.
  function walk(agent, angle, nearer, up = 0) {
    const [dx, dz] = [user.position[0] - agent[0], user.position[2] - agent[2]];
    const distance = clamp(Math.hypot(dx, dz) - nearer, 0.45, 6), bearing = Math.atan2(dx, dz) + angle;
    user.position = [agent[0] + distance * Math.sin(bearing), clamp(user.position[1] + up, 0.9, 2), agent[2] + distance * Math.cos(bearing)];
    user.moved += Math.abs(angle) + Math.abs(nearer) + Math.abs(up);
  }

  user.update = (agent, seconds) => {
    if (user.inHeadset) return;
    const pad = [...(navigator.getGamepads?.() ?? [])].find(Boolean), axis = (i) => (Math.abs(pad?.axes[i] ?? 0) > 0.15 ? pad.axes[i] : 0);
    const key = (...names) => (names.some((n) => held.has(n)) ? 1 : 0);
    const round = key("arrowright", "d") - key("arrowleft", "a") + axis(0);
    const near = key("arrowup", "w") - key("arrowdown", "s") - axis(1);
    const up = key("e", "pageup") - key("q", "pagedown") - axis(3);
    const step = Math.min(0.1, seconds), away = Math.hypot(user.position[0] - agent[0], user.position[2] - agent[2]);
    // At walking speed, however near.
    if (round || near || up) walk(agent, (round * step * SPEED.walk) / Math.max(1, away), near * step * SPEED.walk, up * step * 0.5);
    // The agent may come nearer by itself.
    if (away < 0.4) walk(agent, 0, 0);
  };

  canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); pointers.set(event.pointerId, event); });
  for (const type of ["pointerup", "pointercancel"]) canvas.addEventListener(type, (event) => pointers.delete(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    const other = [...pointers.values()].find((p) => p.pointerId !== event.pointerId);
    pointers.set(event.pointerId, event);
    if (other) {
      const span = (p) => Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY);
      nearer((span(event) - span(before)) * 0.006);
    } else if (user.outside) {
      user.orbit.yaw -= dx * 0.006;
      user.orbit.pitch = clamp(user.orbit.pitch + dy * 0.005, 0.02, 1.5);
    } else {
      walk(user.agent ?? [0, 0, 0], -dx * 0.006, 0, dy * 0.003);
    }
  });
  const nearer = (metres) => {
    if (user.outside) user.orbit.distance = clamp(user.orbit.distance - 2 * metres, 1.5, 12);
    else walk(user.agent ?? [0, 0, 0], 0, metres);
  };
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); nearer(clamp(-event.deltaY, -120, 120) * 0.002); }, { passive: false });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  window.addEventListener("keydown", (event) => {
    const key = event.key.toLowerCase();
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest?.("input, select, dialog, textarea")) return;
    if (key.startsWith("arrow") || key.startsWith("page")) event.preventDefault();
    held.add(key);
  });
  window.addEventListener("keyup", (event) => held.delete(event.key.toLowerCase()));
  window.addEventListener("blur", () => held.clear());

  // What the user sees: {eye, target, matrix, projection, pose}. `inset`: share of the height that panels cover at the foot.
  user.view = (pose, width, height, inset, seconds) => {
    const chest = add(pose.root, [0, 1.22, 0]);
    focus = length(sub(focus, chest)) > 2 ? chest : focus.map((x, k) => mix(x, chest[k], 1 - Math.exp(-seconds * 3)));
    user.agent = focus;
    const aspect = width / Math.max(1, height);
    let eye = user.position, target = focus, fov = aspect < 0.8 ? 1.0 : 0.82;
    if (user.outside) {
      const { yaw, pitch, distance } = user.orbit, back = distance * clamp(0.9 / aspect, 1, 1.6);
      target = add(scale(add(focus, user.position), 0.5), [0, -0.45, 0]);
      eye = add(target, [back * Math.cos(pitch) * Math.sin(yaw), back * Math.sin(pitch), back * Math.cos(pitch) * Math.cos(yaw)]);
      fov = 0.62;
    } else {
      // Near by, the eyes meet the face; far off the whole figure.
      const away = Math.hypot(eye[0] - focus[0], eye[2] - focus[2]);
      target = add(focus, [0, mix(0.28, -0.12, clamp((away - 0.7) / 1.3, 0, 1)), 0]);
    }
    const projection = perspective(fov, aspect, 0.05, 80);
    projection[9] = -inset;
    const camera = lookAt(eye, target);
    return { eye, target: focus, projection, camera, matrix: multiply(projection, camera) };
  };

  // On a screen the user's face points to what is looked at: the agent's.
  user.face = (eyes) => { user.rotation = lookRotation(sub(eyes, user.position)); };
  return user;
}
