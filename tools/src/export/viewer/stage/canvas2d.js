// The scene on a 2-D canvas, where there is no WebGL 2: the same shapes as shaded outlines, far to near.

function createCanvas2d(canvas, d, shapes) {
  const g = canvas.getContext("2d");
  const encode = (c, light = 1) => css(c.map((x) => Math.pow(clamp(x * light, 0, 1), 0.4545)));

  // {x, y, depth, scale (pixels a metre)} of a point, or null behind the eye.
  function seen(view, p) {
    const c = project(view.matrix, p);
    if (c[3] < 0.06) return null;
    return { x: (0.5 + (0.5 * c[0]) / c[3]) * canvas.width, y: (0.5 - (0.5 * c[1]) / c[3]) * canvas.height, depth: c[3], scale: view.scale / c[3] };
  }

  function stroke(view, from, to, width, colour) {
    const a = seen(view, from), b = seen(view, to);
    if (!a || !b) return;
    g.strokeStyle = colour;
    g.lineWidth = Math.max(1, width * 0.5 * (a.scale + b.scale));
    g.beginPath();
    g.moveTo(a.x, a.y);
    g.lineTo(b.x, b.y);
    g.stroke();
  }

  function floor(scene, look) {
    const [cx, , cz] = scene.view.target.map(Math.round);
    for (let k = -8; k <= 8; k++) {
      for (let s = -8; s < 8; s++) {
        const fade = 1 - smoothstep(2, 8.5, Math.hypot(k, s + 0.5));
        if (fade <= 0.02) continue;
        const colour = css(look.grid.slice(0, 3), look.grid[3] * 1.6 * fade);
        stroke(scene.view, [cx + k, 0, cz + s], [cx + k, 0, cz + s + 1], 0.008, colour);
        stroke(scene.view, [cx + s, 0, cz + k], [cx + s + 1, 0, cz + k], 0.008, colour);
      }
    }
  }

  // Each limb's shadow straight below it; the nearer the floor, the darker.
  function shadows(scene, look) {
    g.lineCap = "round";
    for (const s of shapes.all.filter((s) => s.core || s.shade)) {
      const a = scene.pose.carry(s.bone, s.a), b = scene.pose.carry(s.bone, s.b);
      const strength = 0.32 * look.dark * (1 - smoothstep(0.05, 1.3, 0.5 * (a[1] + b[1])));
      if (strength > 0.01) stroke(scene.view, [a[0], 0, a[2]], [b[0], 0, b[2] + 1e-3], 2.6 * s.ra, `rgba(0,0,0,${strength})`);
    }
  }

  function colourOf(shape, look) {
    if (shape.tint) return look.tints[shape.tint];
    const y = 0.5 * (shape.a[1] + shape.b[1]), x = Math.abs(0.5 * (shape.a[0] + shape.b[0]));
    const [sole, waist, collar] = shapes.cloth, [cos, sin, cuff, least] = shapes.sleeve;
    if (y < sole) return look.clothes[2];
    if ((x > least && x * cos + y * sin > cuff) || (y > collar - 0.01 && x < 0.05)) return look.tints[TINT.skin];
    return y < waist ? look.clothes[1] : look.clothes[0];
  }

  // The same, blended with the colour of whom the shape's bone follows, as strongly as in WebGL.
  function whomOf(shape, look, shares) {
    const colour = colourOf(shape, look), strength = shape.tint === TINT.skin ? WHOM.skin : shape.tint ? 0 : WHOM.body;
    return shares ? lerp(colour, dyadicColour(shares[shape.bone]).map((x) => x * x), strength) : colour;
  }

  // Outline of two discs and what lies between, lit from the upper left.
  function cone(a, b, ra, rb, colour) {
    const angle = Math.atan2(b.y - a.y, b.x - a.x), gap = Math.hypot(b.x - a.x, b.y - a.y);
    const bend = Math.acos(clamp((ra - rb) / Math.max(gap, 1e-3), -1, 1));
    g.beginPath();
    if (gap < Math.abs(ra - rb) + 0.5) {
      const big = ra > rb ? a : b;
      g.arc(big.x, big.y, Math.max(ra, rb), 0, 2 * Math.PI);
    } else {
      g.arc(a.x, a.y, ra, angle + bend, angle - bend + 2 * Math.PI);
      g.arc(b.x, b.y, rb, angle - bend, angle + bend);
      g.closePath();
    }
    const r = Math.max(ra, rb), c = { x: 0.5 * (a.x + b.x), y: 0.5 * (a.y + b.y) };
    const across = [Math.sin(angle), -Math.cos(angle)];
    const side = across[0] * 0.5 - across[1] * 0.85 < 0 ? -1 : 1;
    const gradient = g.createLinearGradient(c.x + side * across[0] * r, c.y + side * across[1] * r, c.x - side * across[0] * r, c.y - side * across[1] * r);
    gradient.addColorStop(0, encode(colour, 1.12));
    gradient.addColorStop(0.45, encode(colour, 0.82));
    gradient.addColorStop(1, encode(colour, 0.36));
    g.fillStyle = gradient;
    g.fill();
  }

  function solids(scene, look) {
    const list = [];
    const push = (p, q, ra, rb, colour, nearer = 0) => {
      const a = seen(scene.view, p), b = seen(scene.view, q);
      if (a && b) list.push({ a, b, ra: ra * a.scale, rb: rb * b.scale, colour, depth: 0.5 * (a.depth + b.depth) - nearer });
    };
    for (const s of shapes.all) {
      // Nor can lids, which would hide the eyes.
      if (s.cut && s.tint === TINT.skin) continue;
      const thin = s.s[0] > 1 ? s.s[0] ** 0.5 : 1;
      // Discs cannot be cut: hair is moved away from the face instead.
      const [p, q] = [s.a, s.b].map((x) => (s.cut ? add(x, scale(s.cut, -0.2 * s.ra)) : x));
      push(scene.pose.carry(s.bone, p), scene.pose.carry(s.bone, q), s.ra / thin, s.rb / thin, whomOf(s, look, scene.pose.dyadic));
    }
    const { user, eyes } = scene.pose;
    if (user && !scene.fromUser) {
      const q = lookRotation(eyes ? sub(eyes, user) : [0, 0, 1]);
      for (const s of Object.values(headsetShapes()).flat()) {
        push(add(user, rotate(q, s.a)), add(user, rotate(q, s.b)), s.ra / (s.s[1] > 2 ? 3 : 1), s.rb / (s.s[1] > 2 ? 3 : 1), look.tints[s.tint]);
      }
    }
    list.sort((x, y) => y.depth - x.depth);
    for (const { a, b, ra, rb, colour } of list) cone(a, b, ra, rb, colour);
  }

  function lines(scene, flat) {
    g.lineCap = flat ? "butt" : "round";
    for (const l of scene.lines.filter((l) => l.flat === flat)) {
      const mid = l.c0.map((x, k) => 0.5 * (x + l.c1[k]));
      stroke(scene.view, l.from, l.to, l.width, css(mid.slice(0, 3), mid[3]));
    }
  }

  return {
    name: "canvas2d",
    draw(scene) {
      const look = LOOKS[scene.theme], view = scene.views[0];
      scene = { ...scene, view };
      g.clearRect(0, 0, canvas.width, canvas.height);
      floor(scene, look);
      shadows(scene, look);
      lines(scene, true);
      solids(scene, look);
      lines(scene, false);
    },
  };
}
