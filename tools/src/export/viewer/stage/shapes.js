// A person of round cones on the rig's bind pose. A shape: {bone, a, b, ra, rb, k (blend), s (squeeze of x, y, z), tint}.
// Sizes are those of an adult whose eyes are 1.58 m above the floor, scaled to the rig's.

const TINT = { body: 0, skin: 1, hair: 2, eye: 3, shell: 4, visor: 5, lips: 6, iris: 7, mouth: 8 };
// Bones of the face, after the rig's joints: they ride on the head and are moved by face.js.
const FACE_BONES = ["leftEye", "rightEye", "leftLid", "rightLid", "leftBrow", "rightBrow", "upperLip", "lowerLip", "mouth"];

// Of the arms in the bind pose, radians below the horizontal.
const LOWERED = 0.8;

// Where the edges of the lids stand when the eye is open, degrees above straight ahead.
const LIDS = { open: 13, lower: -21 };

// The pose in which the body is modelled: the rig's T-pose with arms half lowered, so that shoulders bend as little as may be either way.
// A joint's place, and by how much its frame is turned about Z.
function bindPose(d) {
  const at = [], turn = [];
  d.joints.forEach(({ name, parent, offset }, j) => {
    const before = parent === null ? 0 : turn[parent], [s, c] = [Math.sin(before), Math.cos(before)];
    const way = [c * offset[0] - s * offset[1], s * offset[0] + c * offset[1], offset[2]];
    at.push(parent === null ? [...offset] : add(at[parent], way));
    turn.push(before + (name === "leftUpperArm" ? -LOWERED : name === "rightUpperArm" ? LOWERED : 0));
  });
  return { at, turn };
}

function createShapes(d) {
  const joint = (name) => d.index.get(name), bind = bindPose(d);
  const at = (name) => bind.at[joint(name)];
  const has = (...names) => names.every((name) => joint(name) !== undefined);
  const head = has("head") ? at("head") : [0, 1.5, 0];
  const u = Math.max(0.2, head[1] + d.eyes[1]) / 1.58;
  const parts = { body: [], head: [], hair: [], eyes: [], lids: [], mouth: [], leftHand: [], rightHand: [] };
  // Rest-pose centres about which the face's bones turn or stretch, by bone.
  const pivots = {};

  const put = (part, bone, a, b, ra, rb, extra = {}) => {
    const index = FACE_BONES.includes(bone) ? d.joints.length + FACE_BONES.indexOf(bone) : joint(bone);
    if (index === undefined) return;
    parts[part].push({ bone: index, a, b, ra: ra * u, rb: rb * u, k: 0.03 * u, s: [1, 1, 1], ...extra });
  };
  const from = (p, x, y, z) => add(p, [x * u, y * u, z * u]);
  const flat = (z, k = 0.05) => ({ s: [1, 1, z], k: k * u });

  if (has("hips", "leftUpperLeg", "rightUpperLeg")) {
    const [l, r, c] = [at("leftUpperLeg"), at("rightUpperLeg"), at("hips")];
    put("body", "hips", from(lerp(l, c, 0.35), 0, 0.035, -0.005), from(lerp(r, c, 0.35), 0, 0.035, -0.005), 0.106, 0.106, { ...flat(1.05), core: true });
    put("body", "hips", from(l, 0, 0.03, -0.035), from(l, 0, 0.02, -0.035), 0.08, 0.08);
    put("body", "hips", from(r, 0, 0.03, -0.035), from(r, 0, 0.02, -0.035), 0.08, 0.08);
  }
  if (has("hips")) put("body", "hips", from(at("hips"), 0, -0.02, -0.01), from(at("hips"), 0, -0.062, -0.008), 0.085, 0.056, { k: 0.05 * u });
  if (has("spine", "chest")) put("body", "spine", from(at("spine"), 0, -0.02, 0.01), from(at("chest"), 0, 0, 0.012), 0.128, 0.124, { ...flat(1.26, 0.07), core: true });
  if (has("chest")) put("body", "chest", from(at("chest"), 0.035, 0.04, 0.012), from(at("chest"), -0.035, 0.04, 0.012), 0.112, 0.112, { ...flat(1.15), core: true });
  if (has("upperChest")) {
    const c = at("upperChest");
    put("body", "upperChest", from(c, 0.058, 0.02, 0.01), from(c, -0.058, 0.02, 0.01), 0.106, 0.106, { ...flat(1.12), core: true });
    put("body", "upperChest", from(c, 0.066, 0.07, -0.012), from(c, -0.066, 0.07, -0.012), 0.074, 0.074, flat(1.05));
  }
  if (has("neck")) {
    const n = at("neck"), top = lerp(n, head, 1.25);
    put("body", "neck", from(n, 0, -0.02, -0.004), from(top, 0, 0, -0.004), 0.056, 0.05, { k: 0.045 * u });
  }
  for (const [side, x] of [["left", 1], ["right", -1]]) {
    limb(side, x);
    leg(side, x);
    hand(side, x);
  }
  skull();

  function limb(side, x) {
    const names = ["Shoulder", "UpperArm", "LowerArm", "Hand"].map((n) => side + n);
    if (!has(...names.slice(1))) return;
    const [, upper, lower, wrist] = names.map((n) => at(n));
    if (has(names[0], "neck")) {
      put("body", names[0], from(at("neck"), 0.03 * x, -0.005, -0.012), from(upper, -0.03 * x, 0.03, -0.006), 0.043, 0.044, { k: 0.06 * u });
      put("body", names[0], from(upper, -0.05 * x, -0.005, 0), from(upper, -0.014 * x, 0, 0), 0.062, 0.055, { k: 0.05 * u });
    }
    put("body", names[1], upper, lerp(upper, lower, 0.35), 0.055, 0.047, { k: 0.045 * u, ball: 0.9 });
    put("body", names[1], lerp(upper, lower, 0.3), lower, 0.047, 0.038, { shade: true });
    put("body", names[2], lower, lerp(lower, wrist, 0.3), 0.038, 0.04, { ball: 0.93 });
    put("body", names[2], lerp(lower, wrist, 0.3), wrist, 0.04, 0.027, { shade: true });
  }

  function leg(side, x) {
    const names = ["UpperLeg", "LowerLeg", "Foot", "Toes"].map((n) => side + n);
    if (!has(...names.slice(0, 3))) return;
    const [hip, knee, ankle] = names.slice(0, 3).map((n) => at(n));
    put("body", names[0], from(hip, 0.013 * x, -0.01, 0), from(lerp(hip, knee, 0.45), 0.008 * x, 0, 0), 0.081, 0.073, { k: 0.022 * u, ball: 0.84 });
    put("body", names[0], from(lerp(hip, knee, 0.4), 0.008 * x, 0, 0), knee, 0.074, 0.057, { k: 0.022 * u, shade: true });
    put("body", names[1], knee, lerp(knee, ankle, 0.3), 0.057, 0.056, { ball: 0.93 });
    put("body", names[1], from(lerp(knee, ankle, 0.26), 0, 0, -0.02), from(lerp(knee, ankle, 0.4), 0, 0, -0.016), 0.045, 0.042);
    put("body", names[1], lerp(knee, ankle, 0.3), ankle, 0.056, 0.038, { shade: true });
    const toes = has(names[3]) ? at(names[3]) : from(ankle, 0, -0.06, 0.13);
    const sole = (p, r, z) => [p[0], r * u, p[2] + z * u];
    put("body", names[2], sole(ankle, 0.036, -0.028), sole(ankle, 0.036, -0.02), 0.037, 0.037);
    put("body", names[2], sole(ankle, 0.034, -0.01), sole(toes, 0.03, 0), 0.036, 0.034, { s: [0.9, 1, 1], shade: true });
    put("body", names[2], from(ankle, 0, -0.01, 0), from(lerp(ankle, toes, 0.6), 0, 0.012, 0), 0.038, 0.03);
    put("body", has(names[3]) ? names[3] : names[2], sole(toes, 0.029, 0), sole(toes, 0.026, 0.05), 0.033, 0.028, { s: [0.85, 1, 1] });
  }

  function hand(side, x) {
    const name = side + "Hand";
    if (!has(name)) return;
    const w = at(name), part = name;
    const [s, c] = [Math.sin(bind.turn[joint(name)]), Math.cos(bind.turn[joint(name)])];
    const p = (along, up, forward) => from(w, c * along * x - s * up, s * along * x + c * up, forward);
    const tight = { k: 0.012 * u, tint: TINT.skin };
    put(part, name, p(-0.008, 0, 0), p(0.01, 0, 0), 0.0255, 0.024, tight);
    put(part, name, p(0.02, 0, 0.012), p(0.082, -0.002, 0.024), 0.017, 0.013, { ...tight, k: 0.02 * u, shade: true });
    put(part, name, p(0.02, 0, -0.012), p(0.078, -0.002, -0.022), 0.017, 0.013, { ...tight, k: 0.02 * u });
    [[0.088, 0.028, 0.066], [0.091, 0.0095, 0.074], [0.088, -0.009, 0.068], [0.08, -0.027, 0.054]].forEach(([along, forward, long]) => {
      const middle = p(along + 0.55 * long, -0.012, forward * 1.04), tip = p(along + 0.92 * long, -0.034, forward * 1.02);
      put(part, name, p(along - 0.01, -0.001, forward), middle, 0.0098, 0.0088, { ...tight, k: 0.004 * u });
      put(part, name, middle, tip, 0.0088, 0.0072, { ...tight, k: 0.004 * u });
    });
    put(part, name, p(0.015, -0.006, 0.02), p(0.05, -0.014, 0.05), 0.015, 0.0115, tight);
    put(part, name, p(0.05, -0.014, 0.05), p(0.082, -0.022, 0.06), 0.0112, 0.0085, tight);
  }

  function skull() {
    if (!has("head")) return;
    // The eyes' midpoint is a given; the head is built back from it.
    const long = clamp(length(sub(d.eyes, d.headBack)), 0.15 * u, 0.25 * u) / u;
    const c = from(add(head, d.eyes), 0, 0, -0.5 * long);
    const h = 0.5 * long;
    const p = (x, y, z) => from(c, x, y, z);
    const soft = (k, s = [1, 1, 1]) => ({ k: k * u, s, tint: TINT.skin });
    put("head", "head", p(0, 0.028, -0.012), p(0, 0.022, 0.008), h - 0.004, h - 0.008, { ...soft(0.02, [1.2, 1, 1]), shade: true });
    put("head", "head", p(0, -0.02, 0.012), p(0, -0.076, 0.042), 0.07, 0.044, soft(0.03, [1.04, 1, 1]));
    put("head", "head", p(0.03, -0.052, 0.016), p(-0.03, -0.052, 0.016), 0.038, 0.038, soft(0.03));
    put("head", "head", p(0.008, -0.098, 0.066), p(-0.008, -0.098, 0.066), 0.02, 0.02, soft(0.03));
    put("head", "head", p(0.034, -0.026, 0.05), p(-0.034, -0.026, 0.05), 0.028, 0.028, soft(0.03));
    put("head", "head", p(0.03, 0.022, h - 0.022), p(-0.03, 0.022, h - 0.022), 0.013, 0.013, soft(0.014));
    put("head", "head", p(0, 0.006, h - 0.006), p(0, -0.031, h + 0.009), 0.0065, 0.0108, soft(0.012));
    put("head", "head", p(0.009, -0.035, h + 0.001), p(-0.009, -0.035, h + 0.001), 0.0075, 0.0075, soft(0.008));
    // Features lie on the face, wherever the rig's sizes put it: walk in from the front.
    const face = (x, y, out) => {
      const q = p(x, y, 0.25);
      const inside = (z) => parts.head.reduce((d, shape) => smoothMin(d, distanceTo(shape, q[0], q[1], z), shape.k), 1) < 0;
      while (!inside(q[2]) && q[2] > c[2]) q[2] -= 0.0015 * u;
      return from(q, 0, 0, out);
    };
    const feature = (part, bone, tint, r, ...points) => points.slice(1).forEach((q, i) =>
      put(part, bone, face(...points[i]), face(...q), r, r, { tint, k: 0.002 * u }));
    const plane = (n, q) => { const v = unit(n); return [...v, dot(v, q)]; };
    for (const [side, x] of [["left", 1], ["right", -1]]) {
      put("head", "head", p(0.082 * x, 0.004, -0.008), p(0.079 * x, -0.03, -0.002), 0.017, 0.011, soft(0.008, [1.7, 1, 1]));
      const eye = face(0.0325 * x, 0.001, -0.0072);
      const ball = (part, bone, r, extra) => put(part, bone, eye, from(eye, 1e-5, 0, 0), r, r, { k: 0.001, ...extra });
      pivots[`${side}Eye`] = pivots[`${side}Lid`] = eye;
      ball("eyes", `${side}Eye`, 0.0125, { tint: TINT.eye, centre: eye });
      // Lids are half balls around the eye, cut where they end: the upper one turns, the lower one stays.
      const edge = (degrees) => [Math.cos((degrees * Math.PI) / 180), Math.sin((degrees * Math.PI) / 180)];
      const [uc, us] = edge(LIDS.open), [lc, ls] = edge(LIDS.lower);
      ball("lids", `${side}Lid`, 0.0138, { tint: TINT.skin, cut: plane([0.12 * x, -uc, us], eye) });
      ball("lids", "head", 0.0136, { tint: TINT.skin, cut: plane([0, lc, -ls], eye) });
      const brow = `${side}Brow`;
      pivots[brow] = face(0.033 * x, 0.024, 0);
      feature("mouth", brow, TINT.hair, 0.003, [0.047 * x, 0.0195, 0.0005], [0.036 * x, 0.0255, 0.0005], [0.019 * x, 0.0235, 0.0005]);
    }
    pivots.mouth = face(0, -0.0662, 0);
    pivots.upperLip = pivots.lowerLip = pivots.mouth;
    feature("mouth", "mouth", TINT.mouth, 0.0034, [-0.0185, -0.0662, -0.0022], [0, -0.0668, -0.0008], [0.0185, -0.0662, -0.0022]);
    feature("mouth", "upperLip", TINT.lips, 0.0033, [-0.0225, -0.0645, -0.0016], [-0.008, -0.0638, -0.0004], [0, -0.0644, -0.0002], [0.008, -0.0638, -0.0004], [0.0225, -0.0645, -0.0016]);
    feature("mouth", "lowerLip", TINT.lips, 0.0042, [-0.019, -0.0668, -0.0026], [-0.009, -0.0695, -0.0002], [0.009, -0.0695, -0.0002], [0.019, -0.0668, -0.0026]);
    // A cap of hair: a larger skull, cut away below the hairline and in front of the ears.
    const cut = { tint: TINT.hair, k: 0.03 * u, s: [1.18, 1, 1] }, lock = { tint: TINT.hair, k: 0.022 * u };
    put("hair", "head", p(0, 0.034, -0.016), p(0, 0.03, 0.004), h + 0.006, h + 0.001, { ...cut, cut: plane([0, -0.62, 1], p(0, 0.052, 0.062)) });
    put("hair", "head", p(0, 0.0, -0.03), p(0, -0.03, -0.038), h - 0.014, h - 0.03, { ...cut, cut: plane([0, -0.25, 1], p(0, 0, -0.012)) });
    // Volume above the forehead, swept to the side from a parting.
    for (const [x0, x1, y1, r] of [[0.03, -0.03, 0.09, 0.017], [0.03, -0.056, 0.078, 0.016], [0.034, 0.06, 0.08, 0.015]]) {
      put("hair", "head", p(x0, 0.094, h - 0.04), p(x1, y1, h - 0.046), r, 0.8 * r, lock);
    }
  }

  const named = (name, fallback) => (has(name) ? at(name) : fallback);
  const wrist = has("leftHand") ? at("leftHand") : [1e3, 0, 0], sleeve = [Math.cos(LOWERED), -Math.sin(LOWERED)];
  return {
    parts,
    pivots,
    all: Object.values(parts).flat(),
    unit: u,
    // Where the clothes end, in the bind pose: soles, waist, collar (y).
    cloth: [named("leftFoot", [0, 0.08, 0])[1] - 0.006 * u, named("hips", [0, 0.9, 0])[1] + 0.035 * u, named("neck", [0, 1.4, 0])[1] + 0.012 * u],
    // Cuffs: the arm's direction (|x|, y), how far along it they are, and the |x| that only arms reach.
    sleeve: [...sleeve, wrist[0] * sleeve[0] + wrist[1] * sleeve[1] - 0.03 * u, 0.6 * wrist[0]],
    bind,
  };
}

// The user: an egg of a head that wears a headset, around the origin, facing +Z.
function headsetShapes() {
  const shape = (a, b, r, tint, s = [1, 1, 1]) => ({ bone: 0, a, b, ra: r, rb: r, k: 0.012, s, tint });
  return {
    head: [shape([0, 0.03, -0.01], [0, 0.02, 0.005], 0.09, TINT.shell, [1.18, 1, 1]), { ...shape([0, -0.035, 0.018], [0, -0.07, 0.032], 0.064, TINT.shell), rb: 0.042, k: 0.05 }],
    visor: [shape([0.052, 0.006, 0.098], [-0.052, 0.006, 0.098], 0.042, TINT.visor, [1, 1, 1.35])],
    strap: [shape([0, 0.014, -0.006], [0, 0.01, 0.01], 0.096, TINT.visor, [1.17, 4.4, 1])],
  };
}
