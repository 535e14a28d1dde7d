// Whom the body follows, where the recording tells: which joint is looked at, its label on the body, the rows of the panel.

// State {on (whether the body is coloured), joint (pointed at, else chosen, else null)} and its controls. `changed` is called when
// the picture changes.
function createWhom(d, canvas, changed) {
  const $ = (id) => document.getElementById(id);
  const NEAR = 34; // Pixels from a joint within which it is pointed at.
  const TAP = 5; // Pixels that a press may move and still choose.
  const whom = { on: d.dyadic !== null, joint: null };
  let chosen = null, pointed = null, seen = null, press = null;

  // "leftUpperArm" as a person reads it.
  const named = (j) => d.joints[j].name.replace(/[A-Z]/g, (letter) => ` ${letter.toLowerCase()}`);
  const percent = (share) => (share === undefined ? "–" : `${Math.round(100 * share)} %`);

  for (const id of ["whom", "row-follows", "row-joint", "legend"]) $(id).hidden = d.dyadic === null;
  if (d.dyadic) d.joints.forEach((_, j) => $("joint").append(new Option(named(j), j)));

  function look() {
    const joint = pointed ?? chosen;
    $("joint").value = chosen ?? "";
    if (joint === whom.joint) return;
    whom.joint = joint;
    changed();
  }
  whom.choose = (joint) => { chosen = joint; look(); };
  whom.name = (joint) => named(joint);

  // The joint nearest to a place of the canvas, pixels of the page.
  function under(event) {
    if (!d.dyadic || !seen) return null;
    const box = canvas.getBoundingClientRect();
    let best = NEAR, found = null;
    seen.forEach((place, j) => {
      const away = place ? Math.hypot(event.clientX - box.left - place[0], event.clientY - box.top - place[1]) : Infinity;
      if (away < best) [best, found] = [away, j];
    });
    return found;
  }
  canvas.addEventListener("pointermove", (event) => { if (!event.buttons && event.pointerType !== "touch") { pointed = under(event); look(); } });
  canvas.addEventListener("pointerleave", () => { pointed = null; look(); });
  canvas.addEventListener("pointerdown", (event) => { press = [event.clientX, event.clientY]; });
  canvas.addEventListener("pointerup", (event) => {
    if (press && Math.hypot(event.clientX - press[0], event.clientY - press[1]) < TAP) whom.choose(under(event));
    press = null;
  });
  $("joint").addEventListener("change", () => whom.choose($("joint").value === "" ? null : Number($("joint").value)));

  // What a frame tells; `view` is null where no label is wanted. Width and height of the canvas, pixels of the page.
  whom.draw = (pose, view, width, height) => {
    if (!d.dyadic) return;
    const shares = d.dyadic[pose.frame];
    seen = view && pose.position.map((p) => {
      const at = project(view.matrix, p);
      return at[3] < 0.1 ? null : [(0.5 + (0.5 * at[0]) / at[3]) * width, (0.5 - (0.5 * at[1]) / at[3]) * height];
    });
    $("follows").textContent = percent(shares ? shares.reduce((a, b) => a + b, 0) / shares.length : undefined);
    $("follows-joint").textContent = whom.joint === null ? "" : percent(shares?.[whom.joint]);
    $("legend").toggleAttribute("data-off", !whom.on);
    const place = whom.joint === null ? null : seen?.[whom.joint];
    $("joint-label").hidden = !place;
    if (!place) return;
    $("joint-label").style.transform = `translate(${place[0]}px, ${place[1]}px)`;
    $("joint-label").firstElementChild.textContent = `${named(whom.joint)} ${percent(shares?.[whom.joint])}`;
  };
  return whom;
}
