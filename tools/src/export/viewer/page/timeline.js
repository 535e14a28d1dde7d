// The lanes at the foot of the page: both voices or what is heard, gaze, whom the body follows where that is told, sounds in the room, and the play head. Click or drag to seek.

function createTimeline(canvas, d, whom, onSeek) {
  const g = canvas.getContext("2d");
  const lanes = [
    { name: "Agent", kind: "voice", samples: d.agentVoice, colour: "--agent" },
    { name: "User", kind: "voice", samples: d.userVoice, colour: "--user" },
    { name: "Gaze", kind: "gaze" },
  ];
  if (d.sounds && !d.agentVoice && !d.userVoice) lanes.splice(0, 2, { name: "Heard", kind: "voice", samples: d.heard, colour: "--user" });
  if (d.dyadic) lanes.push({ name: "Dyadic", kind: "dyadic" });
  if (d.sounds) lanes.push({ name: "Sounds", kind: "sounds" });
  canvas.dataset.lanes = lanes.length;
  const still = document.createElement("canvas");
  let key = "";
  const margin = (ratio) => 46 * ratio;

  // Largest sample of each pixel column, 0 to 1 of the voice's loudest.
  function peaks(samples, columns) {
    const out = new Float32Array(columns), per = (d.duration * d.audioRate) / columns;
    let top = 1;
    for (let c = 0; c < columns; c++) {
      const end = Math.min(samples.length, Math.ceil((c + 1) * per));
      for (let i = Math.floor(c * per); i < end; i++) out[c] = Math.max(out[c], Math.abs(samples[i]));
      top = Math.max(top, out[c]);
    }
    return out.map((p) => p / top);
  }

  // Draws all lanes once in full colour; the part still to come is dimmed when shown.
  function paint(w, h, ratio, style) {
    still.width = w;
    still.height = h;
    const s = still.getContext("2d"), left = margin(ratio), wide = w - left, high = h / lanes.length;
    const variable = (name) => style.getPropertyValue(name).trim();
    s.font = `500 ${11 * ratio}px ${style.fontFamily}`;
    s.textBaseline = "middle";
    lanes.forEach((lane, row) => {
      const middle = (row + 0.5) * high, half = 0.42 * high;
      s.fillStyle = variable("--dim");
      s.fillText(lane.name, 0, middle);
      s.fillStyle = variable("--line");
      s.fillRect(left, Math.round(middle), wide, 1);
      if (lane.kind === "gaze") return gaze(s, left, wide, middle, half, ratio, variable);
      if (lane.kind === "dyadic") return dyadic(s, left, wide, middle, half, ratio, variable);
      if (lane.kind === "sounds") return sounds(s, left, wide, middle, half, ratio, variable);
      if (!lane.samples) {
        s.fillStyle = variable("--dim");
        return s.fillText("no voice", left + 8 * ratio, middle - 7 * ratio);
      }
      s.fillStyle = variable(lane.colour);
      const bar = Math.max(1, Math.round(2 * ratio)), gap = Math.max(1, Math.round(ratio));
      const tops = peaks(lane.samples, Math.max(1, Math.floor(wide / (bar + gap))));
      tops.forEach((p, i) => { if (p > 0.01) s.fillRect(left + i * (bar + gap), middle - p * half, bar, Math.max(1, 2 * p * half)); });
    });
  }

  function gaze(s, left, wide, middle, half, ratio, variable) {
    // From 0 at the lane's foot to 1 at its top; below 0 counts as 0.
    const y = (score) => middle + half - 2 * half * clamp(score, 0, 1);
    if (d.gazeTarget !== null) {
      s.setLineDash([4 * ratio, 4 * ratio]);
      s.strokeStyle = variable("--dim");
      s.beginPath();
      s.moveTo(left, y(d.gazeTarget));
      s.lineTo(left + wide, y(d.gazeTarget));
      s.stroke();
      s.setLineDash([]);
    }
    s.lineWidth = 1.75 * ratio;
    s.lineJoin = "round";
    const every = Math.max(1, Math.floor(d.frames / wide));
    for (let i = 0; i + every < d.frames; i += every) {
      const [a, b] = [d.gaze[i], d.gaze[i + every]];
      if (Number.isNaN(a) || Number.isNaN(b)) continue;
      s.strokeStyle = css(gazeColour(0.5 * (a + b)));
      s.beginPath();
      s.moveTo(left + (wide * i) / d.frames, y(a));
      s.lineTo(left + (wide * (i + every)) / d.frames, y(b));
      s.stroke();
    }
  }

  // From 0 to the largest share of all, in tenths.
  const top = d.dyadic ? Math.max(0.1, Math.ceil(10 * d.dyadic.reduce((most, all) => Math.max(most, ...(all ?? [])), 0)) / 10) : 1;
  // How much the body follows the user: largest share of the joints and mean, or mean and the joint that is looked at. Frames that
  // do not tell are a gap.
  function dyadic(s, left, wide, middle, half, ratio, variable) {
    const every = Math.max(1, Math.floor(d.frames / wide)), joint = whom.joint;
    const mean = (all) => all.reduce((a, b) => a + b, 0) / all.length;
    const curves = joint === null
      ? [[(all) => Math.max(...all), (share) => css(dyadicColour(share), 0.35)], [mean, (share) => css(dyadicColour(share))]]
      : [[mean, (share) => css(dyadicColour(share), 0.5)], [(all) => all[joint], () => variable("--ink")]];
    s.lineWidth = 1.75 * ratio;
    for (const [of, colour] of curves) {
      const share = (i) => (d.dyadic[i] ? of(d.dyadic[i]) / top : NaN);
      for (let i = 0; i + every < d.frames; i += every) {
        const [a, b] = [share(i), share(i + every)];
        if (Number.isNaN(a) || Number.isNaN(b)) continue;
        s.strokeStyle = colour(0.5 * top * (a + b));
        s.beginPath();
        s.moveTo(left + (wide * i) / d.frames, middle + half - 2 * half * a);
        s.lineTo(left + (wide * (i + every)) / d.frames, middle + half - 2 * half * b);
        s.stroke();
      }
    }
    s.fillStyle = variable(joint === null ? "--dim" : "--ink");
    s.textAlign = "right";
    const of = joint === null ? "mean and largest" : whom.name(joint);
    s.fillText(`${of}, to ${Math.round(100 * top)} %`, left + wide, middle - half + 2 * ratio);
    s.textAlign = "left";
  }

  // A bar for each source while it sounds, with its name; those that sound together below each other.
  const rows = [];
  for (const source of [...(d.sounds ?? [])].sort((a, b) => a.seconds[0] - b.seconds[0])) {
    const row = rows.find((others) => others[others.length - 1].seconds[1] <= source.seconds[0]);
    if (row) row.push(source); else rows.push([source]);
  }
  function sounds(s, left, wide, middle, half, ratio, variable) {
    const at = (seconds) => left + (wide * clamp(seconds, 0, d.duration)) / Math.max(d.duration, 1e-6), high = (2 * half) / rows.length;
    rows.forEach((row, k) => row.forEach(({ name, seconds: [from, to] }) => {
      const x = at(from), y = middle - half + k * high, w = Math.max(3 * ratio, at(to) - x);
      s.fillStyle = css(SOUND);
      s.beginPath();
      s.roundRect(x, y, w, Math.max(2 * ratio, high - ratio), 3 * ratio);
      s.fill();
      if (high < 10 * ratio) return;
      // Beside the bar where it does not fit in.
      const inside = s.measureText(name).width + 8 * ratio < w;
      s.fillStyle = inside ? "#1b1206" : variable("--dim");
      s.fillText(name, inside ? x + 4 * ratio : x + w + 4 * ratio, y + 0.5 * high);
    }));
  }

  const timeAt = (event) => {
    const box = canvas.getBoundingClientRect();
    return clamp((event.clientX - box.left - margin(1)) / (box.width - margin(1)), 0, 1) * d.duration;
  };
  canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); onSeek(timeAt(event)); });
  canvas.addEventListener("pointermove", (event) => { if (canvas.hasPointerCapture(event.pointerId)) onSeek(timeAt(event)); });

  return {
    draw(time, theme) {
      const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
      const w = Math.round(box.width * ratio), h = Math.round(box.height * ratio);
      if (!w || !h) return;
      if (canvas.width !== w) canvas.width = w;
      if (canvas.height !== h) canvas.height = h;
      const style = getComputedStyle(canvas);
      if (key !== (key = `${w} ${h} ${theme} ${whom.joint}`)) paint(w, h, ratio, style);
      const head = margin(ratio) + ((w - margin(ratio)) * time) / Math.max(d.duration, 1e-6);
      g.clearRect(0, 0, w, h);
      g.globalAlpha = 0.36;
      g.drawImage(still, 0, 0);
      g.globalAlpha = 1;
      if (head >= 1) g.drawImage(still, 0, 0, head, h, 0, 0, head, h);
      g.fillStyle = style.color;
      g.beginPath();
      g.roundRect(head - ratio, 0, 2 * ratio, h, ratio);
      g.fill();
    },
  };
}
