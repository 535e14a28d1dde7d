// The panels: what the numbers of the shown frame are.

function createHud(d) {
  const $ = (id) => document.getElementById(id);
  const clock = (t) => `${Math.floor(t / 60)}:${(t % 60).toFixed(2).padStart(5, "0")}`;
  const shown = new Map();
  // Writes only what changed: text nodes are the page's slowest part.
  const set = (id, text) => { if (shown.get(id) !== text) { shown.set(id, text); $(id).textContent = text; } };
  const flag = (id, on) => { if (shown.get(id) !== on) { shown.set(id, on); $(id).dataset.on = on; } };

  $("title").textContent = d.title;
  $("subtitle").textContent = d.subtitle;
  const facts = [...d.facts, ["Length", `${d.duration.toFixed(1)} s, ${d.frames} frames at ${d.fps} fps`], ["Joints", `${d.joints.length}`]];
  for (const [name, value] of facts) {
    $("facts").append(Object.assign(document.createElement("dt"), { textContent: name }), Object.assign(document.createElement("dd"), { textContent: value }));
  }
  set("target", d.gazeTarget === null ? "free" : d.gazeTarget.toFixed(2));
  $("mark").hidden = d.gazeTarget === null;
  if (d.gazeTarget !== null) $("mark").style.left = `${100 * clamp(d.gazeTarget, 0, 1)}%`;
  for (const who of ["agent", "user"]) $(`speaks-${who}`).hidden = !d.speech[who];
  // A generator that tells whom the joints follow has no samplers, and its poses are on the rig.
  $("row-fit").hidden = d.dyadic?.every((shares) => shares) ?? false;
  if (d.dyadic) set("made-with", "Generator");

  const labels = (d.sounds ?? []).map(({ name }) => Object.assign(document.createElement("div"), { className: "source-label", textContent: name, hidden: true }));
  $("sources").append(...labels);
  // Where a point above `p` is seen, as a transform of what stands there; null behind the eye.
  const over = (view, p, up, width, height) => {
    const at = project(view.matrix, add(p, [0, up, 0]));
    return at[3] < 0.1 ? null : `translate(-50%, -100%) translate(${(0.5 + (0.5 * at[0]) / at[3]) * width}px, ${(0.5 - (0.5 * at[1]) / at[3]) * height}px)`;
  };

  return {
    clock,
    draw(time, pose, view, width, height) {
      const i = pose.frame, known = !Number.isNaN(pose.gaze);
      set("time", clock(time));
      set("length", clock(d.duration));
      set("gaze", known ? pose.gaze.toFixed(2) : "–");
      $("bar").style.width = `${known ? 100 * clamp(pose.gaze, 0, 1) : 0}%`;
      $("bar").style.background = css(gazeColour(known ? pose.gaze : 0));
      for (const who of ["agent", "user"]) {
        const levels = d.speech[who];
        if (!levels) continue;
        const level = Math.max(...levels.subarray(Math.max(0, i - 9), i + 1));
        flag(`speaks-${who}`, level > 0.06);
        $(`speaks-${who}`).style.setProperty("--level", clamp(levels[i], 0, 1).toFixed(2));
      }
      set("sampler", d.dyadic?.[i] ? "dram" : d.samplers[d.sampler[i]] ?? "–");
      flag("foot-left", (d.touch[i] & 1) > 0);
      flag("foot-right", (d.touch[i] & 2) > 0);
      set("fit", d.frames ? `${(1000 * d.fit[i]).toFixed(1)} mm` : "–");
      set("frame", d.frames ? `${d.start + i}` : "–");
      const scrub = $("scrub");
      if (Number(scrub.value) !== i) scrub.value = i;
      scrub.style.setProperty("--done", `${(100 * time) / Math.max(d.duration, 1e-6)}%`);
      scrub.setAttribute("aria-valuetext", `${time.toFixed(2)} seconds of ${d.duration.toFixed(1)}`);
      const label = $("user-label");
      const place = pose.user && view ? over(view, pose.user, 0.2, width, height) : null;
      label.hidden = !place;
      if (label.hidden) return;
      label.style.transform = place;
      set("user-distance", `${Math.hypot(pose.user[0] - pose.root[0], pose.user[2] - pose.root[2]).toFixed(1)} m`);
    },
    // Names of what sounds, at their places; `view` is null where no label is wanted.
    sources(sources, view, width, height) {
      sources.forEach(({ at, on }, i) => {
        const place = on && view ? over(view, at, 0.22, width, height) : null;
        labels[i].hidden = !place;
        if (place) labels[i].style.transform = place;
      });
    },
  };
}
