// The scene in WebGL 2.

// A renderer {draw(scene)}, or null where there is no WebGL 2.
//
// A scene: pose, views [{matrix, eye, target, viewport (null: the whole canvas)}], lines, theme, fromUser (no headset drawn), joints
// (lines before everything), backdrop (sky and rug instead of a bare grid), seeThrough (only shadows: the room is the user's own),
// bodiless (another avatar has the body), framebuffer (default: the canvas's).
function createWebgl(canvas, d, shapes, options = {}) {
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, premultipliedAlpha: true, powerPreference: "low-power", ...options });
  if (!gl || 4 * (d.joints.length + FACE_BONES.length) + 64 > gl.getParameter(gl.MAX_VERTEX_UNIFORM_VECTORS)) return null;

  const body = program(BODY_VERTEX(d.joints.length + FACE_BONES.length), BODY_FRAGMENT);
  const floor = program(FLOOR_VERTEX, FLOOR_FRAGMENT);
  const line = program(LINE_VERTEX, LINE_FRAGMENT);
  const sky = program(SKY_VERTEX, SKY_FRAGMENT);
  const person = upload(bodyMesh(d, shapes));
  const headset = upload(headsetMesh());
  const square = attributes([[0, 2, gl.FLOAT, false, 8, 0]], new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]));
  const strip = attributes([[0, 3, gl.FLOAT, false, 28, 0], [1, 4, gl.FLOAT, false, 28, 12]], new Float32Array(0));

  let calls = 0, triangles = 0;

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
      [3, 4, gl.UNSIGNED_BYTE, true, 36, 28], [4, 4, gl.UNSIGNED_BYTE, true, 36, 32]];
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

  function common(shader, view, caps) {
    shader.use();
    gl.uniformMatrix4fv(shader.place("uView"), false, view.matrix);
    gl.uniform4fv(shader.place("uCapA"), caps.a);
    gl.uniform4fv(shader.place("uCapB"), caps.b);
    gl.uniform1i(shader.place("uCaps"), caps.n);
  }

  // What is far, around the eye: a box whose corners give directions.
  function drawSky(view, look) {
    sky.use();
    gl.uniformMatrix4fv(sky.place("uView"), false, view.matrix);
    gl.uniform3fv(sky.place("uEye"), view.eye);
    gl.uniform3fv(sky.place("uSky"), look.sky);
    gl.uniform3fv(sky.place("uFloor"), look.floor);
    gl.bindVertexArray(square.array);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, 6);
    calls++;
  }

  function drawFloor(scene, view, look, caps) {
    common(floor, view, caps);
    gl.uniform3fv(floor.place("uCentre"), view.target);
    gl.uniform4f(floor.place("uScene"), scene.backdrop ? 1 : 0, scene.seeThrough ? 1 : 0, scene.place?.[0] ?? 0, scene.place?.[2] ?? 0);
    gl.uniform3fv(floor.place("uRug"), look.rug);
    gl.uniform3fv(floor.place("uFloor"), look.floor);
    gl.uniform4fv(floor.place("uGrid"), look.grid);
    gl.uniform1f(floor.place("uDark"), look.dark);
    gl.bindVertexArray(square.array);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    calls++;
  }

  function drawMesh(mesh, bones, alpha) {
    gl.uniform4fv(body.place("uBones"), bones);
    gl.uniform1f(body.place("uAlpha"), alpha);
    gl.bindVertexArray(mesh.array);
    gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
    calls++;
    triangles += mesh.count / 3;
  }

  function drawBodies(scene, view, look, caps) {
    common(body, view, caps);
    gl.uniform3fv(body.place("uEye"), view.eye);
    gl.uniform3fv(body.place("uTints"), look.tints.flat());
    gl.uniform3fv(body.place("uClothes"), look.clothes.flat());
    gl.uniform3fv(body.place("uCloth"), shapes.cloth);
    gl.uniform4fv(body.place("uSleeve"), shapes.sleeve);
    gl.uniform1f(body.place("uShade"), look.shade);
    // Squared: the colours are those of screens, light is reckoned linearly.
    const linear = (c, strength) => [...c.map((x) => x * x), scene.pose.dyadic ? strength : 0];
    if (scene.pose.dyadic) gl.uniform1fv(body.place("uShares"), scene.pose.dyadic);
    gl.uniform4fv(body.place("uOwn"), linear(dyadicColour(0), WHOM.body));
    gl.uniform4fv(body.place("uFollows"), linear(dyadicColour(1), WHOM.skin));
    if (!scene.bodiless) drawMesh(person, scene.pose.skin, 1);
    const { user, eyes } = scene.pose;
    if (!user || scene.fromUser) return;
    // Its heading is not recorded: it is drawn facing the agent.
    const q = lookRotation(eyes ? sub(eyes, user) : [0, 0, 1]);
    const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => rotate(q, axis));
    drawMesh(headset, [0, 1, 2].flatMap((r) => [axes[0][r], axes[1][r], axes[2][r], user[r]]), 1);
  }

  function drawLines(view, lines) {
    if (!lines.length) return;
    const data = lineVertices(lines, view.eye);
    line.use();
    gl.uniformMatrix4fv(line.place("uView"), false, view.matrix);
    gl.bindVertexArray(strip.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, strip.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    gl.drawArrays(gl.TRIANGLES, 0, data.length / 7);
    calls++;
  }

  // Whoever else draws in this context leaves its own state behind.
  function prepare(framebuffer) {
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.disable(gl.SCISSOR_TEST);
    gl.disable(gl.CULL_FACE);
    gl.disable(gl.STENCIL_TEST);
    gl.colorMask(true, true, true, true);
    gl.depthMask(true);
    gl.enable(gl.BLEND);
    gl.blendEquation(gl.FUNC_ADD);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthFunc(gl.LEQUAL);
    gl.clearColor(0, 0, 0, 0);
    gl.clearDepth(1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  }

  return {
    name: "webgl2",
    gl,
    counts: () => ({ calls, triangles }),
    draw(scene) {
      const look = LOOKS[scene.theme], caps = capsules(scene);
      calls = triangles = 0;
      prepare(scene.framebuffer ?? null);
      for (const view of scene.views) {
        const { x, y, width, height } = view.viewport ?? { x: 0, y: 0, width: canvas.width, height: canvas.height };
        gl.viewport(x, y, width, height);
        gl.disable(gl.DEPTH_TEST);
        if (scene.backdrop && !scene.seeThrough) drawSky(view, look);
        drawFloor(scene, view, look, caps);
        drawLines(view, scene.lines.filter((l) => l.flat));
        gl.enable(gl.DEPTH_TEST);
        drawBodies(scene, view, look, caps);
        gl.depthMask(false);
        if (scene.joints) gl.disable(gl.DEPTH_TEST);
        drawLines(view, scene.lines.filter((l) => !l.flat));
        gl.depthMask(true);
      }
      gl.bindVertexArray(null);
    },
  };
}
