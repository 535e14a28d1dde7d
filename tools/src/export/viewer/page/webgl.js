// The scene in WebGL 2.

const LOOKS = {
  dark: {
    floor: [0.140, 0.153, 0.192], grid: [0.66, 0.72, 0.90, 0.22], dark: 0.75, shade: 0.86,
    tints: [[0, 0, 0], [0.80, 0.52, 0.39], [0.055, 0.040, 0.038], [0.012, 0.012, 0.016], [0.50, 0.56, 0.68], [0.022, 0.025, 0.033], [0.50, 0.20, 0.17]],
    clothes: [[0.20, 0.33, 0.50], [0.050, 0.058, 0.082], [0.60, 0.58, 0.55]],
  },
  light: {
    floor: [0.925, 0.932, 0.948], grid: [0.30, 0.35, 0.48, 0.20], dark: 0.52, shade: 1.12,
    tints: [[0, 0, 0], [0.80, 0.52, 0.39], [0.060, 0.044, 0.040], [0.012, 0.012, 0.016], [0.62, 0.68, 0.78], [0.03, 0.034, 0.045], [0.50, 0.20, 0.17]],
    clothes: [[0.17, 0.32, 0.52], [0.060, 0.070, 0.100], [0.66, 0.64, 0.61]],
  },
};

// A renderer {draw(scene)}, or null where there is no WebGL 2.
function createWebgl(canvas, d, shapes) {
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, premultipliedAlpha: true, powerPreference: "low-power" });
  if (!gl || 3 * d.joints.length + 64 > gl.getParameter(gl.MAX_VERTEX_UNIFORM_VECTORS)) return null;

  const body = program(BODY_VERTEX(Math.max(1, d.joints.length)), BODY_FRAGMENT);
  const floor = program(FLOOR_VERTEX, FLOOR_FRAGMENT);
  const line = program(LINE_VERTEX, LINE_FRAGMENT);
  const person = upload(bodyMesh(d, shapes));
  const headset = upload(headsetMesh());
  const square = attributes([[0, 2, gl.FLOAT, false, 8, 0]], new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]));
  const strip = attributes([[0, 3, gl.FLOAT, false, 28, 0], [1, 4, gl.FLOAT, false, 28, 12]], new Float32Array(0));
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.depthFunc(gl.LEQUAL);

  function program(vertex, fragment) {
    const p = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(p, shader);
    }
    gl.linkProgram(p);
    if (!gl.getProgramParameter(p, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(p));
    const places = new Map();
    const place = (name) => { if (!places.has(name)) places.set(name, gl.getUniformLocation(p, name)); return places.get(name); };
    return { use: () => gl.useProgram(p), place };
  }

  function attributes(list, data) {
    const array = gl.createVertexArray(), buffer = gl.createBuffer();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    for (const [where, ...rest] of list) {
      gl.enableVertexAttribArray(where);
      gl.vertexAttribPointer(where, ...rest);
    }
    return { array, buffer };
  }

  function upload({ data, indices }) {
    const layout = [[0, 3, gl.FLOAT, false, 36, 0], [1, 3, gl.FLOAT, false, 36, 12], [2, 4, gl.UNSIGNED_BYTE, false, 36, 24],
      [3, 4, gl.UNSIGNED_BYTE, true, 36, 28], [4, 2, gl.UNSIGNED_BYTE, true, 36, 32]];
    const mesh = attributes(layout, data);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
    return { ...mesh, count: indices.length };
  }

  // Shadow capsules: (end, radius) and (end, strength).
  function capsules(scene) {
    const a = new Float32Array(4 * CAPSULES), b = new Float32Array(4 * CAPSULES);
    let n = 0;
    const push = (p, q, r, strength) => {
      if (n === CAPSULES) return;
      a.set([...p, r], 4 * n);
      b.set([...q, strength], 4 * n++);
    };
    for (const s of shapes.all.filter((s) => s.core || s.shade)) {
      push(scene.pose.carry(s.bone, s.a), scene.pose.carry(s.bone, s.b), 0.5 * (s.ra + s.rb) / Math.max(1, s.s[2] ** 0.5), 1);
    }
    if (scene.pose.user && !scene.fromUser) push(scene.pose.user, add(scene.pose.user, [0, 0.03, 0]), 0.1, 0.8);
    return { a, b, n };
  }

  function common(shader, scene, caps) {
    shader.use();
    gl.uniformMatrix4fv(shader.place("uView"), false, scene.view.matrix);
    gl.uniform4fv(shader.place("uCapA"), caps.a);
    gl.uniform4fv(shader.place("uCapB"), caps.b);
    gl.uniform1i(shader.place("uCaps"), caps.n);
  }

  function drawFloor(scene, look, caps) {
    common(floor, scene, caps);
    gl.uniform3fv(floor.place("uCentre"), scene.view.target);
    gl.uniform3fv(floor.place("uFloor"), look.floor);
    gl.uniform4fv(floor.place("uGrid"), look.grid);
    gl.uniform1f(floor.place("uDark"), look.dark);
    gl.bindVertexArray(square.array);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }

  function drawMesh(mesh, bones, alpha) {
    gl.uniform4fv(body.place("uBones"), bones);
    gl.uniform1f(body.place("uAlpha"), alpha);
    gl.bindVertexArray(mesh.array);
    gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
  }

  function drawBodies(scene, look, caps) {
    common(body, scene, caps);
    gl.uniform3fv(body.place("uEye"), scene.view.eye);
    gl.uniform3fv(body.place("uTints"), look.tints.flat());
    gl.uniform3fv(body.place("uClothes"), look.clothes.flat());
    gl.uniform4fv(body.place("uCloth"), shapes.cloth);
    gl.uniform1f(body.place("uShade"), look.shade);
    drawMesh(person, scene.pose.skin, 1);
    const { user, eyes } = scene.pose;
    if (!user || scene.fromUser) return;
    // Its heading is not recorded: it is drawn facing the agent.
    const q = lookRotation(eyes ? sub(eyes, user) : [0, 0, 1]);
    const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => rotate(q, axis));
    drawMesh(headset, [0, 1, 2].flatMap((r) => [axes[0][r], axes[1][r], axes[2][r], user[r]]), 1);
  }

  function drawLines(scene, lines) {
    if (!lines.length) return;
    const data = lineVertices(lines, scene.view.eye);
    line.use();
    gl.uniformMatrix4fv(line.place("uView"), false, scene.view.matrix);
    gl.bindVertexArray(strip.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, strip.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    gl.drawArrays(gl.TRIANGLES, 0, data.length / 7);
  }

  return {
    name: "webgl2",
    draw(scene) {
      const look = LOOKS[scene.theme], caps = capsules(scene);
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.disable(gl.DEPTH_TEST);
      drawFloor(scene, look, caps);
      drawLines(scene, scene.lines.filter((l) => l.flat));
      gl.enable(gl.DEPTH_TEST);
      drawBodies(scene, look, caps);
      gl.depthMask(false);
      if (scene.joints) gl.disable(gl.DEPTH_TEST);
      drawLines(scene, scene.lines.filter((l) => !l.flat));
      gl.depthMask(true);
    },
  };
}
