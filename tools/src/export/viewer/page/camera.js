// Orbit camera: angles about a target that may follow the agent, or the user's own view.

function createCamera(d, view) {
  const HOME = { yaw: -0.8, pitch: 0.17, distance: 5.3, height: 0.9 };
  const FOV = 0.56;
  const camera = { ...HOME, follow: true, fromUser: false, centre: [0, 0.9, 0] };

  // Mean root within 0.7 s of the moment, drawn towards the user: follows without shaking, and the same for the same moment.
  function agentAt(time, toUser = 0) {
    const reach = Math.round(0.7 * d.fps), i = Math.round(time * d.fps);
    const sum = [0, 0], side = [0, 0];
    let n = 0;
    for (let k = Math.max(0, i - reach); k <= Math.min(d.frames - 1, i + reach); k++, n++) {
      sum[0] += d.root[3 * k];
      sum[1] += d.root[3 * k + 1];
      if (Number.isNaN(d.user[3 * k])) continue;
      side[0] += d.user[3 * k] - d.root[3 * k];
      side[1] += d.user[3 * k + 2] - d.root[3 * k + 1];
    }
    if (!n) return [0, camera.height, 0];
    const share = Math.min(toUser, 0.7 / Math.max(0.1, Math.hypot(...side) / n));
    return [(sum[0] + share * side[0]) / n, camera.height, (sum[1] + share * side[1]) / n];
  }

  camera.home = () => Object.assign(camera, HOME, { follow: true, fromUser: false });
  camera.orbit = (yaw, pitch) => {
    camera.fromUser = false;
    camera.yaw += yaw;
    camera.pitch = clamp(camera.pitch + pitch, -0.15, 1.52);
  };
  camera.zoom = (factor) => { camera.distance = clamp(camera.distance * factor, 0.6, 25); };
  camera.pan = (right, up) => {
    camera.follow = false;
    const [s, c] = [Math.sin(camera.yaw), Math.cos(camera.yaw)];
    camera.centre = add(camera.centre, [c * right, up, -s * right]);
    camera.centre[1] = clamp(camera.centre[1], 0, 3);
  };

  // {eye, target, matrix, scale} for a canvas of this size; `inset` is the share of the height that panels cover below.
  camera.at = (time, pose, width, height, inset) => {
    if (camera.follow) camera.centre = agentAt(time, 0.34 * smoothstep(1.5, 4, camera.distance));
    let target = camera.centre, eye;
    // A tall window sees less to the sides, one with high panels less below: step back.
    const aspect = width / Math.max(1, height);
    const back = camera.distance * clamp(0.8 / aspect, 1, 1.7) * clamp(0.78 / (1 - inset), 1, 1.5);
    if (camera.fromUser && pose.user) {
      eye = pose.user;
      target = add(agentAt(time), [0, 0.25, 0]);
    } else {
      const flat = back * Math.cos(camera.pitch);
      eye = add(target, [flat * Math.sin(camera.yaw), back * Math.sin(camera.pitch), flat * Math.cos(camera.yaw)]);
      eye[1] = Math.max(0.06, eye[1]);
    }
    const fov = camera.fromUser ? FOV * 1.9 : FOV;
    const lens = perspective(fov, aspect, 0.05, 80);
    // Shifts the picture up so that the agent stands clear of the panels.
    lens[9] = -inset;
    return { eye, target, matrix: multiply(lens, lookAt(eye, target)), scale: (0.5 * height) / Math.tan(fov / 2) };
  };

  view.addEventListener("pointerdown", (event) => { view.setPointerCapture(event.pointerId); pointers.set(event.pointerId, event); });
  const pointers = new Map();
  const drop = (event) => pointers.delete(event.pointerId);
  view.addEventListener("pointerup", drop);
  view.addEventListener("pointercancel", drop);
  view.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    const others = [...pointers.values()].filter((p) => p.pointerId !== event.pointerId);
    pointers.set(event.pointerId, event);
    if (others.length) {
      const span = (p) => Math.hypot(p.clientX - others[0].clientX, p.clientY - others[0].clientY);
      camera.zoom(Math.max(1, span(before)) / Math.max(1, span(event)));
    } else if (event.shiftKey || event.buttons === 2 || event.buttons === 4) {
      camera.pan((-dx * camera.distance) / 900, (dy * camera.distance) / 900);
    } else {
      camera.orbit(-dx * 0.006, dy * 0.005);
    }
    camera.changed?.();
  });
  view.addEventListener("wheel", (event) => {
    event.preventDefault();
    camera.zoom(Math.exp(clamp(event.deltaY, -240, 240) * 0.0012));
    camera.changed?.();
  }, { passive: false });
  view.addEventListener("contextmenu", (event) => event.preventDefault());
  return camera;
}
