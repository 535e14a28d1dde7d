// Lines as thin triangles, for both renderers: {points: [from, to], width (m), colour: [r, g, b, a] at both ends}.

// Everything drawn as lines in one moment.
// Options: trail (lines of the user's way), colour (the user's mark), joints (decoded positions), gazeLine,
// sources (of sound: at, whether it is on, seconds since it began).
function sceneLines(d, pose, options) {
  const out = [];
  const line = (from, to, width, c0, c1 = c0, flat = false) => out.push({ from, to, width, c0, c1, flat });
  out.push(...(options.trail ?? []));
  if (pose.user && !options.fromUser) {
    const foot = [pose.user[0], 0.006, pose.user[2]], c = options.colour ?? timeColour(0.5);
    out.push(...ringLines(foot, 0.13, [...c, 0.9]));
    line(foot, add(pose.user, [0, -0.14, 0]), 0.006, [...c, 0.75], [...c, 0.15]);
  }
  if (pose.eyes && options.gazeLine !== false) {
    const c = gazeColour(Number.isNaN(pose.gaze) ? 0 : pose.gaze);
    const start = add(pose.eyes, scale(pose.facing, 0.03));
    const far = options.fromUser ? 0.35 : pose.user ? Math.min(2.2, length(sub(pose.user, pose.eyes))) : 1.2;
    line(start, add(pose.eyes, scale(pose.facing, far)), 0.011, [...c, 0.9], [...c, 0]);
    if (pose.user && !options.fromUser) dashes(pose.eyes, add(pose.user, scale(unit(sub(pose.eyes, pose.user)), 0.13)), c);
  }
  out.push(...sourceLines(options.sources ?? []));
  if (options.joints) {
    const decoded = options.joints;
    decoded.forEach((p, j) => {
      const parent = d.joints[j].parent;
      const c = pose.dyadic ? dyadicColour(pose.dyadic[j]) : [1, 0.85, 0.3];
      line(add(p, [0, -0.009, 0]), add(p, [0, 0.009, 0]), 0.018, [...c, 0.95]);
      if (parent !== null) line(decoded[parent], p, 0.006, [...c, 0.8]);
    });
  }
  return out;

  function dashes(from, to, colour) {
    const n = Math.max(1, Math.round(length(sub(to, from)) / 0.09));
    for (let k = 2; k < n; k++) line(lerp(from, to, k / n), lerp(from, to, (k + 0.45) / n), 0.007, [...colour, 0.62]);
  }
}

// A circle on the floor.
function ringLines(centre, radius, colour) {
  const p = (k) => add(centre, [radius * Math.sin((k * Math.PI) / 14), 0, radius * Math.cos((k * Math.PI) / 14)]);
  return Array.from({ length: 28 }, (_, k) => ({ from: p(k), to: p(k + 1), width: 0.014, c0: colour, c1: colour, flat: true }));
}

// Sources of sound {at, on, age (seconds since it began)}: a star that is bright while it sounds, with rings that go out from it, above
// its place on the floor.
function sourceLines(sources) {
  return sources.flatMap(({ at, on, age }) => {
    const out = [], line = (from, to, width, c0, c1) => out.push({ from, to, width, c0, c1, flat: false });
    const light = on ? 0.75 + 0.2 * Math.sin(age * 9) : 0.22, reach = on ? 0.17 : 0.08;
    for (let k = 0; k < 12; k++) {
      const a = (k * Math.PI) / 6, tilt = Math.PI * (k % 3 - 1) / 3;
      const ray = scale([Math.cos(a) * Math.cos(tilt), Math.sin(tilt), Math.sin(a) * Math.cos(tilt)], reach);
      line(at, add(at, ray), on ? 0.05 : 0.02, [...SOUND, light], [...SOUND, 0]);
    }
    const foot = [at[0], 0.006, at[2]];
    line(foot, at, 0.006, [...SOUND, 0.5 * light], [...SOUND, light]);
    for (let k = 0; k < (on ? 3 : 1); k++) {
      const way = on ? (age * 0.8 + k / 3) % 1 : 0;
      out.push(...ringLines(foot, 0.12 + 0.9 * way, [...SOUND, light * (1 - way)]));
    }
    return out;
  });
}

// Two triangles a line, 7 floats a vertex; flat lines lie on the floor, others face the eye.
function lineVertices(lines, eye) {
  const out = new Float32Array(lines.length * 42);
  let o = 0;
  for (const { from, to, width, c0, c1, flat } of lines) {
    const along = sub(to, from);
    const side = scale(unit(flat ? [along[2], 0, -along[0]] : cross(along, sub(eye, from))), width / 2);
    const [a, b, c, e] = [add(from, side), sub(from, side), add(to, side), sub(to, side)];
    for (const [p, colour] of [[a, c0], [b, c0], [c, c1], [c, c1], [b, c0], [e, c1]]) {
      out.set(p, o);
      out.set(colour, o + 3);
      o += 7;
    }
  }
  return out;
}
