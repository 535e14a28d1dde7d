// The pose at any time: forward kinematics on the fixed-bone-length rig, interpolated between frames.

function createPose(d) {
  const n = d.joints.length;
  const pose = {
    frame: 0,
    position: d.joints.map(() => [0, 0, 0]),
    rotation: new Float32Array(4 * n),
    // Three rows of four a joint: rest-pose point to world.
    skin: new Float32Array(12 * n),
    root: [0, 0, 0],
    user: null,
    gaze: NaN,
  };
  const local = new Float32Array(4);

  const between = (track, i, k, f, width) => mix(track[i * width + k], track[Math.min(i + 1, d.frames - 1) * width + k], f);

  function localRotation(j, i, f) {
    const a = 4 * (i * n + j), b = 4 * (Math.min(i + 1, d.frames - 1) * n + j);
    let same = 0;
    for (let k = 0; k < 4; k++) same += d.local[a + k] * d.local[b + k];
    const sign = same < 0 ? -1 : 1;
    for (let k = 0; k < 4; k++) local[k] = mix(d.local[a + k], sign * d.local[b + k], f);
    const norm = Math.hypot(local[0], local[1], local[2], local[3]) || 1;
    for (let k = 0; k < 4; k++) local[k] /= norm;
  }

  function compose(j, parent) {
    const r = pose.rotation, o = 4 * j;
    const [x, y, z, w] = local;
    if (parent === null) return r.set(local, o);
    const p = 4 * parent;
    const [a, b, c, s] = [r[p], r[p + 1], r[p + 2], r[p + 3]];
    r[o] = s * x + a * w + b * z - c * y;
    r[o + 1] = s * y - a * z + b * w + c * x;
    r[o + 2] = s * z + a * y - b * x + c * w;
    r[o + 3] = s * w - a * x - b * y - c * z;
  }

  function skin(j) {
    const [x, y, z, w] = pose.rotation.subarray(4 * j, 4 * j + 4);
    const rows = [
      [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
      [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
      [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ];
    rows.forEach((row, r) => pose.skin.set([...row, pose.position[j][r] - dot(row, d.rest[j])], 12 * j + 4 * r));
  }

  pose.update = (time) => {
    if (!d.frames) return pose;
    const exact = clamp(time * d.fps, 0, d.frames - 1);
    const i = Math.floor(exact + 1e-6), f = Math.max(0, exact - i);
    pose.frame = i;
    d.joints.forEach((joint, j) => {
      localRotation(j, i, f);
      compose(j, joint.parent);
      pose.position[j] = joint.parent === null
        ? [0, 1, 2].map((k) => between(d.hips, i, k, f, 3))
        : add(pose.position[joint.parent], rotate(pose.rotation, joint.offset, 4 * joint.parent));
      skin(j);
    });
    pose.root = [between(d.root, i, 0, f, 3), 0, between(d.root, i, 1, f, 3)];
    const here = [...d.user.subarray(3 * i, 3 * i + 3)], next = d.user.subarray(3 * Math.min(i + 1, d.frames - 1));
    pose.user = Number.isNaN(here[0]) ? null : Number.isNaN(next[0]) ? here : lerp(here, next, f);
    pose.gaze = d.gaze[i];
    const head = d.index.get("head");
    if (head !== undefined) {
      pose.eyes = add(pose.position[head], rotate(pose.rotation, d.eyes, 4 * head));
      pose.facing = unit(rotate(pose.rotation, sub(d.eyes, d.headBack), 4 * head));
    }
    return pose;
  };

  // A point of the rest pose, carried by joint j.
  pose.carry = (j, p) => add(pose.position[j], rotate(pose.rotation, sub(p, d.rest[j]), 4 * j));
  // Decoded joint positions of the shown frame, before the rig's bone lengths were imposed.
  pose.decoded = () => d.joints.map((_, j) => [0, 1, 2].map((k) =>
    d.decoded[3 * (pose.frame * n + j) + k] * d.step + (k === 0 ? d.root[3 * pose.frame] : k === 2 ? d.root[3 * pose.frame + 1] : 0)));
  return pose;
}
