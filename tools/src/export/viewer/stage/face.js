// Life in the face. Nothing of this comes from the model, whose body ends at the head: eyes that look at the user as far as the
// frame's gaze score says, blinks, and a mouth that opens with the voice. A function of time, seed and what is heard and seen.

// Uniform 0 to 1 of two whole numbers.
function hashed(a, b) {
  let h = Math.imul(a ^ 0x9e3779b9, 0x85ebca6b) ^ Math.imul(b + 0x7f4a7c15, 0xc2b2ae35);
  h = Math.imul(h ^ (h >>> 15), 0x2c1b3c6d);
  h = Math.imul(h ^ (h >>> 12), 0x297a2d39);
  return ((h ^ (h >>> 15)) >>> 0) / 4294967296;
}

// Blinks: about 17 a minute, gaps log-normal (median 3.1 s, never under 0.7 s); 90 ms down, 40 ms shut, 160 ms up.
function createBlinks(seed) {
  let index = 0, start = 0.8;
  const gap = (i) => {
    const normal = Math.sqrt(-2 * Math.log(1e-9 + hashed(seed, 2 * i))) * Math.cos(2 * Math.PI * hashed(seed, 2 * i + 1));
    return Math.max(0.7, 3.1 * Math.exp(0.5 * normal));
  };
  return (time) => {
    if (time < start - 1) [index, start] = [0, 0.8];
    while (time > start + 0.35) start += gap(index++);
    const t = time - start;
    return smoothstep(0, 0.09, t) * (1 - smoothstep(0.13, 0.29, t));
  };
}

function createFace(d, shapes, seed = 1) {
  const head = d.index.get("head"), base = 12 * d.joints.length, u = shapes.unit;
  const blink = createBlinks(seed);
  const face = { open: 0, blink: 0, yaw: 0, pitch: 0 };
  const LIMIT = { yaw: 0.5, pitch: 0.33 };

  // Share of the moment that the eyes are with the user: some contact even at low scores, and short looks away at high ones.
  function contact(time, score) {
    const stretch = Math.floor(time / 1.7 + 0.4 * hashed(seed, Math.floor(time / 17)));
    return hashed(seed + 7, stretch) < clamp(0.2 + 0.85 * score, 0.1, 0.96) ? 1 : 0;
  }

  // Angles to a point in the head's frame, in reach of the eyes.
  function angles(pose, at) {
    const q = pose.rotation.subarray(4 * head, 4 * head + 4);
    const v = rotate([-q[0], -q[1], -q[2], q[3]], sub(at, pose.eyes));
    return [clamp(Math.atan2(v[0], v[2]), -LIMIT.yaw, LIMIT.yaw), clamp(-Math.atan2(v[1], Math.hypot(v[0], v[2])), -LIMIT.pitch, LIMIT.pitch)];
  }

  // `level`: loudness of the agent's voice, 0 to 1. Writes the face's bones behind the rig's in pose.skin.
  face.update = (pose, time, level, seconds) => {
    if (head === undefined || !pose.eyes) return;
    const away = Math.floor(time / 1.7), user = pose.user;
    let [yaw, pitch] = [0.3 * (hashed(seed + 1, away) - 0.5), 0.1 + 0.12 * (hashed(seed + 2, away) - 0.5)];
    if (user && contact(time, Number.isNaN(pose.gaze) || pose.gaze === null ? 0.5 : pose.gaze)) [yaw, pitch] = angles(pose, user);
    // Small jumps a few times a second, as resting eyes make them.
    const dart = Math.floor(time * 2.3);
    yaw += 0.022 * (hashed(seed + 3, dart) - 0.5);
    pitch += 0.016 * (hashed(seed + 4, dart) - 0.5);
    // A saccade takes some 60 ms; after a jump in time there is no way to go.
    const step = seconds > 0 && seconds < 0.5 ? 1 - Math.exp(-seconds / 0.022) : 1;
    face.yaw = mix(face.yaw, yaw, step);
    face.pitch = mix(face.pitch, pitch, step);
    const wide = clamp(level, 0, 1) * (0.72 + 0.28 * Math.sin(time * 23 + 3 * Math.sin(time * 7.3)));
    face.open = mix(face.open, wide, seconds > 0 && seconds < 0.5 ? 1 - Math.exp(-seconds / (wide > face.open ? 0.025 : 0.06)) : 1);
    face.blink = blink(time);
    write(pose);
  };

  function write(pose) {
    const { open } = face, at = (name) => shapes.pivots[name];
    const shut = (0.92 * face.blink + clamp(0.55 * face.pitch, -0.12, 0.25)) * 1.02;
    const turned = (yaw, pitch) => lookTurn(yaw, pitch);
    bone("leftEye", turned(face.yaw, face.pitch));
    bone("rightEye", turned(face.yaw, face.pitch));
    for (const side of ["leftLid", "rightLid"]) bone(side, turned(0, shut));
    const lift = 0.0022 * u * smoothstep(0.25, 0.9, open) - 0.001 * u * face.blink;
    for (const side of ["leftBrow", "rightBrow"]) bone(side, null, [0, lift, 0]);
    bone("upperLip", null, [0, 0.002 * u * open, -0.0006 * u * open], [1 - 0.12 * open, 1, 1]);
    bone("lowerLip", null, [0, -0.0105 * u * open, -0.002 * u * open], [1 - 0.16 * open, 1, 1]);
    bone("mouth", null, [0, -0.0042 * u * open, -0.0006 * u * open], [1 - 0.08 * open, 0.25 + 1.75 * open, 1]);

    // Turned and stretched about its pivot, moved, and carried by the head.
    function bone(name, rows, move = [0, 0, 0], stretch = [1, 1, 1]) {
      const pivot = at(name), k = base + 12 * FACE_BONES.indexOf(name), h = 12 * head;
      if (!pivot) return;
      const m = rows ?? [[stretch[0], 0, 0], [0, stretch[1], 0], [0, 0, stretch[2]]];
      const offset = m.map((row, r) => pivot[r] + move[r] - dot(row, pivot));
      for (let r = 0; r < 3; r++) {
        const a = pose.skin.subarray(h + 4 * r, h + 4 * r + 4);
        for (let c = 0; c < 3; c++) pose.skin[k + 4 * r + c] = a[0] * m[0][c] + a[1] * m[1][c] + a[2] * m[2][c];
        pose.skin[k + 4 * r + 3] = a[0] * offset[0] + a[1] * offset[1] + a[2] * offset[2] + a[3];
      }
    }
  }

  return face;
}

// Rows of the rotation that turns +Z by `yaw` to +X and then by `pitch` downwards.
function lookTurn(yaw, pitch) {
  const [sy, cy, sp, cp] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
  return [[cy, sy * sp, sy * cp], [0, cp, -sp], [-sy, cy * sp, cy * cp]];
}
