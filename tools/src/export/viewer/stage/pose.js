// The pose at a moment: forward kinematics on the fixed-bone-length rig, between two frames.

function createPose(d) {
  const n = d.joints.length, bind = bindPose(d);
  const pose = {
    position: d.joints.map(() => [0, 0, 0]),
    rotation: new Float32Array(4 * n),
    // Three rows of four a joint, then a bone of the face (face.js): bind-pose point to world.
    skin: new Float32Array(12 * (n + FACE_BONES.length)),
    root: [0, 0, 0],
    user: null,
    gaze: NaN,
    // How much each bone follows the user, 0 to 1, or null where that is not told.
    dyadic: null,
  };
  const shares = new Float32Array(n + FACE_BONES.length);
  const local = new Float32Array(4);

  function localRotation(j, a, b, f) {
    const o = 4 * j;
    let same = 0;
    for (let k = 0; k < 4; k++) same += a.local[o + k] * b.local[o + k];
    const sign = same < 0 ? -1 : 1;
    for (let k = 0; k < 4; k++) local[k] = mix(a.local[o + k], sign * b.local[o + k], f);
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
    const [sin, cos] = [Math.sin(bind.turn[j]), Math.cos(bind.turn[j])];
    rows.forEach(([i, k, l], r) => {
      const row = [i * cos - k * sin, i * sin + k * cos, l];
      pose.skin.set([...row, pose.position[j][r] - dot(row, bind.at[j])], 12 * j + 4 * r);
    });
  }

  // A moment between two frames {root [x, z], hips, local (four numbers a joint, of any scale), gaze, user or null,
  // dyadic (a number a joint) or none}.
  pose.set = (a, b, f) => {
    d.joints.forEach((joint, j) => {
      localRotation(j, a, b, f);
      compose(j, joint.parent);
      pose.position[j] = joint.parent === null
        ? lerp(a.hips, b.hips, f)
        : add(pose.position[joint.parent], rotate(pose.rotation, joint.offset, 4 * joint.parent));
      skin(j);
    });
    pose.root = [mix(a.root[0], b.root[0], f), 0, mix(a.root[1], b.root[1], f)];
    pose.user = a.user && b.user ? lerp(a.user, b.user, f) : a.user;
    pose.gaze = a.gaze;
    pose.dyadic = a.dyadic && b.dyadic ? shares : null;
    if (pose.dyadic) {
      for (let j = 0; j < n; j++) shares[j] = mix(a.dyadic[j], b.dyadic[j], f);
      shares.fill(shares[d.index.get("head") ?? 0], n);
    }
    const head = d.index.get("head");
    if (head !== undefined) {
      pose.eyes = add(pose.position[head], rotate(pose.rotation, d.eyes, 4 * head));
      pose.facing = unit(rotate(pose.rotation, sub(d.eyes, d.headBack), 4 * head));
    }
    return pose;
  };

  // A point of the bind pose, carried by joint j or by a bone of the face.
  pose.carry = (j, p) => [0, 4, 8].map((row) => {
    const [x, y, z, w] = pose.skin.subarray(12 * j + row, 12 * j + row + 4);
    return x * p[0] + y * p[1] + z * p[2] + w;
  });
  return pose;
}
