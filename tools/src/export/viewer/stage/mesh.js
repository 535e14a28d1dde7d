// Meshes from shapes: a signed distance field on a grid, turned into a smooth surface (surface nets) with skin weights.

// Distance to a shape: a capsule whose radius runs from ra to rb, squeezed along the axes.
function distanceTo(shape, x, y, z) {
  const { a, b, s } = shape;
  const bx = (b[0] - a[0]) * s[0], by = (b[1] - a[1]) * s[1], bz = (b[2] - a[2]) * s[2];
  const px = (x - a[0]) * s[0], py = (y - a[1]) * s[1], pz = (z - a[2]) * s[2];
  const t = clamp((px * bx + py * by + pz * bz) / Math.max(1e-12, bx * bx + by * by + bz * bz), 0, 1);
  let d = Math.hypot(px - t * bx, py - t * by, pz - t * bz) - mix(shape.ra, shape.rb, t);
  d /= Math.max(s[0], s[1], s[2]) ** 0.5;
  if (shape.cut) d = Math.max(d, x * shape.cut[0] + y * shape.cut[1] + z * shape.cut[2] - shape.cut[3]);
  return d;
}

// Polynomial smooth minimum of width k.
function smoothMin(a, b, k) {
  const h = Math.max(k - Math.abs(a - b), 0) / k;
  return Math.min(a, b) - 0.25 * h * h * k;
}

function distanceField(shapes, cell) {
  const reach = (shape) => Math.max(shape.ra, shape.rb) / Math.min(1, ...shape.s) + shape.k + 4 * cell;
  const low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
  for (const shape of shapes) {
    for (let k = 0; k < 3; k++) {
      low[k] = Math.min(low[k], Math.min(shape.a[k], shape.b[k]) - reach(shape));
      high[k] = Math.max(high[k], Math.max(shape.a[k], shape.b[k]) + reach(shape));
    }
  }
  const size = low.map((l, k) => Math.ceil((high[k] - l) / cell) + 1);
  const values = new Float32Array(size[0] * size[1] * size[2]).fill(1e3);
  for (const shape of shapes) {
    const r = reach(shape);
    const first = low.map((l, k) => Math.max(0, Math.floor((Math.min(shape.a[k], shape.b[k]) - r - l) / cell)));
    const last = low.map((l, k) => Math.min(size[k] - 1, Math.ceil((Math.max(shape.a[k], shape.b[k]) + r - l) / cell)));
    for (let z = first[2]; z <= last[2]; z++) {
      for (let y = first[1]; y <= last[1]; y++) {
        let i = (z * size[1] + y) * size[0] + first[0];
        for (let x = first[0]; x <= last[0]; x++, i++) {
          const d = distanceTo(shape, low[0] + x * cell, low[1] + y * cell, low[2] + z * cell);
          values[i] = values[i] > 100 ? d : smoothMin(values[i], d, shape.k);
        }
      }
    }
  }
  // Trilinear value at a point; outside the grid there is nothing.
  const sample = (p) => {
    const g = p.map((x, k) => (x - low[k]) / cell), b = g.map(Math.floor);
    if (b.some((x, k) => x < 0 || x >= size[k] - 1)) return 1e3;
    const f = g.map((x, k) => x - b[k]);
    const v = (x, y, z) => values[((b[2] + z) * size[1] + b[1] + y) * size[0] + b[0] + x];
    const line = (y, z) => mix(v(0, y, z), v(1, y, z), f[0]);
    return mix(mix(line(0, 0), line(1, 0), f[1]), mix(line(0, 1), line(1, 1), f[1]), f[2]);
  };
  return { low, size, cell, values, sample };
}

// Naive surface nets (Gibson 1998): one vertex a cell that the surface crosses, one quad an edge it crosses.
function surface(field) {
  const { low, size, cell, values } = field;
  const [nx, ny, nz] = size;
  const step = [1, nx, nx * ny];
  const vertexOf = new Int32Array(values.length).fill(-1);
  const points = [], faces = [];
  for (let z = 0; z < nz - 1; z++) for (let y = 0; y < ny - 1; y++) for (let x = 0; x < nx - 1; x++) {
    const base = (z * ny + y) * nx + x;
    let inside = 0;
    for (let c = 0; c < 8; c++) if (values[base + (c & 1) + ((c >> 1) & 1) * nx + (c >> 2) * step[2]] < 0) inside++;
    if (inside === 0 || inside === 8) continue;
    const sum = [0, 0, 0];
    let n = 0;
    for (let axis = 0; axis < 3; axis++) for (let c = 0; c < 4; c++) {
      const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
      const corner = base + (c & 1) * step[u] + (c >> 1) * step[v];
      const [d0, d1] = [values[corner], values[corner + step[axis]]];
      if (d0 < 0 === d1 < 0) continue;
      sum[axis] += d0 / (d0 - d1);
      sum[u] += c & 1;
      sum[v] += c >> 1;
      n++;
    }
    vertexOf[base] = points.length;
    points.push([x, y, z].map((g, k) => low[k] + (g + sum[k] / n) * cell));
  }
  for (let z = 1; z < nz - 1; z++) for (let y = 1; y < ny - 1; y++) for (let x = 1; x < nx - 1; x++) {
    const base = (z * ny + y) * nx + x;
    for (let axis = 0; axis < 3; axis++) {
      const [d0, d1] = [values[base], values[base + step[axis]]];
      if (d0 < 0 === d1 < 0) continue;
      const [u, v] = [step[(axis + 1) % 3], step[(axis + 2) % 3]];
      const quad = [vertexOf[base - u - v], vertexOf[base - v], vertexOf[base], vertexOf[base - u]];
      if (quad.some((q) => q < 0)) continue;
      const [a, b, c, e] = d0 < 0 ? quad : [quad[3], quad[2], quad[1], quad[0]];
      faces.push(a, b, c, a, c, e);
    }
  }
  return { points, faces };
}

// Appends the surface of `shapes` to `mesh`; `parents` restricts weights to neighbouring bones.
function appendSurface(mesh, shapes, cell, parents) {
  if (!shapes.length) return;
  const field = distanceField(shapes, cell);
  const { points, faces } = surface(field);
  const base = mesh.count;
  const near = (a, b) => a === b || (a < parents.length && b < parents.length && (parents[a] === b || parents[b] === a));
  for (const p of points) {
    const e = 0.75 * cell;
    const slope = (k) => { const q = [0, 0, 0]; q[k] = e; return field.sample(add(p, q)) - field.sample(sub(p, q)); };
    const normal = unit([slope(0), slope(1), slope(2)]);
    // Ambient occlusion in the bind pose: how much nearer than expected other surfaces are, going out along the normal.
    let shade = 0;
    for (const h of [0.02, 0.045, 0.08]) shade += clamp(h - field.sample(add(p, scale(normal, h))), 0, h) / h;
    const distances = shapes.map((shape) => distanceTo(shape, ...p));
    const nearest = distances.indexOf(Math.min(...distances));
    const bone = shapes[nearest].bone;
    const best = new Map();
    shapes.forEach((shape, i) => {
      if (!near(shape.bone, bone)) return;
      const w = Math.exp((distances[nearest] - distances[i]) / 0.018);
      best.set(shape.bone, Math.max(best.get(shape.bone) || 0, w));
    });
    const { tint = 0, centre } = shapes[nearest];
    const look = centre ? unit(sub(p, centre)) : [0, 0, 1];
    pushVertex(mesh, p, normal, [...best].sort((x, y) => y[1] - x[1]).slice(0, 4), tint, 1 - (centre ? 0.1 : 0.26) * shade, look);
  }
  for (const f of faces) mesh.indices.push(base + f);
}

// A vertex is 36 bytes: position, normal (f32), four bones, four weights (u8), tint, occlusion (u8), and for eyes where from their
// centre it lies, x and y (-1 to 1 as u8; behind: off the iris).
function pushVertex(mesh, p, normal, weights, tint, occlusion, look = [0, 0, 1]) {
  const total = weights.reduce((sum, [, w]) => sum + w, 0);
  const bones = [0, 0, 0, 0], shares = [0, 0, 0, 0];
  weights.forEach(([bone, w], i) => { bones[i] = bone; shares[i] = Math.round((255 * w) / total); });
  shares[0] += 255 - shares.reduce((sum, s) => sum + s, 0);
  const side = look[2] < 0 ? unit([look[0], look[1], 0]) : look;
  mesh.vertices.push([p, normal, bones, shares, tint, Math.round(255 * clamp(occlusion, 0, 1)), side]);
  mesh.count++;
}

function packMesh(mesh) {
  const data = new DataView(new ArrayBuffer(36 * mesh.count));
  mesh.vertices.forEach(([p, n, bones, shares, tint, occlusion, look], i) => {
    for (let k = 0; k < 3; k++) {
      data.setFloat32(36 * i + 4 * k, p[k], true);
      data.setFloat32(36 * i + 12 + 4 * k, n[k], true);
    }
    for (let k = 0; k < 4; k++) {
      data.setUint8(36 * i + 24 + k, bones[k]);
      data.setUint8(36 * i + 28 + k, shares[k]);
    }
    data.setUint8(36 * i + 32, tint);
    data.setUint8(36 * i + 33, occlusion);
    for (let k = 0; k < 2; k++) data.setUint8(36 * i + 34 + k, Math.round(127.5 + 127.5 * look[k]));
  });
  return { data: data.buffer, indices: new Uint32Array(mesh.indices) };
}

const emptyMesh = () => ({ vertices: [], indices: [], count: 0 });

function bodyMesh(d, shapes) {
  const mesh = emptyMesh();
  const parents = d.joints.map((joint) => joint.parent);
  const { body, head, hair, eyes, lids, mouth, leftHand, rightHand } = shapes.parts;
  appendSurface(mesh, body, 0.014 * shapes.unit, parents);
  for (const part of [head, hair]) appendSurface(mesh, part, 0.0048 * shapes.unit, parents);
  for (const part of [leftHand, rightHand]) appendSurface(mesh, part, 0.0042 * shapes.unit, parents);
  for (const bone of new Set(mouth.map((s) => s.bone))) appendSurface(mesh, mouth.filter((s) => s.bone === bone), 0.0022 * shapes.unit, parents);
  for (const part of [...eyes, ...lids]) appendSurface(mesh, [part], 0.0022 * shapes.unit, parents);
  // Linear blending thins bent joints: rigid balls inside keep elbows, knees, shoulders and hips full.
  for (const shape of body.filter((s) => s.ball)) {
    const r = shape.ball * shape.ra;
    appendSurface(mesh, [{ ...shape, b: shape.a, ra: r, rb: r }], 0.012 * shapes.unit, parents);
  }
  return packMesh(mesh);
}

function headsetMesh() {
  const mesh = emptyMesh();
  for (const part of Object.values(headsetShapes())) appendSurface(mesh, part, 0.006, [null]);
  return packMesh(mesh);
}
