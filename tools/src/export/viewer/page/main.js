// Joins the parts: state, clock, keys, buttons, and the drawing loop.

const page = document.documentElement;
let errors = 0;
function fail(what) {
  page.dataset.errors = ++errors;
  page.dataset.state = "error";
  const box = document.getElementById("failure");
  box.hidden = false;
  box.textContent = `This recording cannot be shown: ${what}`;
}
window.addEventListener("error", (event) => fail(event.message));
window.addEventListener("unhandledrejection", (event) => fail(event.reason?.message ?? "rejected"));
page.dataset.errors = 0;

try { start(); } catch (error) { fail(error.message); }

function start() {
  const $ = (id) => document.getElementById(id);
  const d = loadRecording();
  const options = new Map(decodeURIComponent(location.hash.slice(1)).split("&").filter(Boolean).map((part) => {
    const [name, ...value] = part.split("=");
    return [name, value.join("=")];
  }));
  const calm = matchMedia("(prefers-reduced-motion: reduce)");
  const state = { time: 0, playing: false, speed: 1, loop: true, joints: false, clock: null };
  const SPEEDS = [0.25, 0.5, 0.75, 1, 1.5, 2];
  const last = Math.max(0, (d.frames - 1) / d.fps);

  const canvas = $("scene");
  const shapes = createShapes(d), pose = createPose(d), pieces = trailPieces(d), audio = createAudio(d), hud = createHud(d);
  const camera = createCamera(d, canvas);
  const face = createFace(d, shapes);
  const renderer = (options.has("fallback") ? null : createWebgl(canvas, d, shapes)) ?? createCanvas2d(canvas, d, shapes);
  const whom = createWhom(d, canvas, redraw);
  const timeline = createTimeline($("lanes"), d, whom, seek);
  page.dataset.renderer = renderer.name;
  camera.changed = redraw;

  // Time and playback ------------------------------------------------------------------------------------------------
  function seek(time) {
    state.time = clamp(time, 0, last);
    if (state.playing) restart();
    redraw();
  }
  function restart() {
    state.clock = { at: performance.now(), time: state.time };
    if (state.playing) audio.play(state.time, state.speed);
  }
  function play(on) {
    if (on && state.time >= last) state.time = 0;
    state.playing = on;
    if (on) restart(); else audio.stop();
    press("play", on, on ? "Pause" : "Play");
    redraw();
  }
  function setSpeed(speed) {
    state.speed = clamp(speed, 0.25, 2);
    $("speed").value = String(SPEEDS.reduce((a, b) => (Math.abs(b - state.speed) < Math.abs(a - state.speed) ? b : a)));
    restart();
  }
  const stepSpeed = (by) => setSpeed(SPEEDS[clamp(SPEEDS.indexOf(Number($("speed").value)) + by, 0, SPEEDS.length - 1)]);
  const stepFrame = (by) => { play(false); seek((Math.round(state.time * d.fps) + by) / d.fps); };
  function advance() {
    const silent = state.clock.time + ((performance.now() - state.clock.at) / 1000) * state.speed;
    state.time = audio.time() ?? silent;
    if (state.time < last) return;
    state.time = last;
    if (state.loop) seek(0); else play(false);
  }

  // Switches ---------------------------------------------------------------------------------------------------------
  function press(id, on, label) {
    $(id).setAttribute("aria-pressed", on);
    if (label) { $(id).setAttribute("aria-label", label); $(id).title = `${label} (${$(id).dataset.key})`; }
  }
  const theme = () => page.dataset.theme || (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark");
  const switches = {
    loop: () => press("loop", (state.loop = !state.loop)),
    mute: () => { audio.mute(!audio.muted); press("mute", audio.muted, audio.muted ? "Unmute" : "Mute"); },
    follow: () => press("follow", (camera.follow = !camera.follow)),
    view: () => press("view", (camera.fromUser = !camera.fromUser)),
    joints: () => press("joints", (state.joints = !state.joints)),
    whom: () => press("whom", (whom.on = d.dyadic !== null && !whom.on)),
    theme: () => { page.dataset.theme = theme() === "dark" ? "light" : "dark"; },
    clean: () => page.toggleAttribute("data-clean"),
    home: () => { camera.home(); sync(); },
    help: () => ($("help").open ? $("help").close() : $("help").showModal()),
  };
  function sync() {
    press("follow", camera.follow);
    press("view", camera.fromUser);
  }
  for (const [name, act] of Object.entries(switches)) $(name)?.tagName === "BUTTON" && $(name).addEventListener("click", () => { act(); redraw(); });
  $("play").addEventListener("click", () => play(!state.playing));
  $("open-help").addEventListener("click", switches.help);
  $("close-help").addEventListener("click", switches.help);
  $("speed").addEventListener("change", () => setSpeed(Number($("speed").value)));
  $("scrub").max = Math.max(0, d.frames - 1);
  $("scrub").addEventListener("input", () => seek(Number($("scrub").value) / d.fps));
  $("mute").hidden = !audio.available;

  const keys = {
    " ": () => play(!state.playing), k: () => play(!state.playing),
    ArrowLeft: (e) => (e.shiftKey ? seek(state.time - 1) : stepFrame(-1)), ArrowRight: (e) => (e.shiftKey ? seek(state.time + 1) : stepFrame(1)),
    ArrowUp: () => seek(state.time + 5), ArrowDown: () => seek(state.time - 5), Home: () => seek(0), End: () => seek(last),
    "[": () => stepSpeed(-1), "]": () => stepSpeed(1), a: () => camera.orbit(-0.1, 0), d: () => camera.orbit(0.1, 0),
    w: () => camera.orbit(0, 0.07), s: () => camera.orbit(0, -0.07), "+": () => camera.zoom(0.9), "=": () => camera.zoom(0.9), "-": () => camera.zoom(1.11),
    l: switches.loop, m: switches.mute, f: switches.follow, v: switches.view, j: switches.joints, c: switches.whom, t: switches.theme, h: switches.clean, r: switches.home, "?": switches.help,
  };
  window.addEventListener("keydown", (event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const target = event.target;
    // Buttons keep the space bar, the speed list its arrows, the help dialog its own keys.
    if (event.ctrlKey || event.metaKey || event.altKey || !keys[key]) return;
    if (target.closest("dialog") && key !== "?") return;
    if ((key === " " && target.tagName === "BUTTON") || (target.tagName === "SELECT" && (key.startsWith("Arrow") || key === " "))) return;
    event.preventDefault();
    keys[key](event);
    if ("awsd".includes(key)) sync();
    redraw();
  });

  // Drawing ----------------------------------------------------------------------------------------------------------
  let pending = false, shown = 0;
  function redraw() {
    if (pending) return;
    pending = true;
    requestAnimationFrame(() => { pending = false; draw(); if (state.playing) redraw(); });
  }
  function draw() {
    if (state.playing) advance();
    const ratio = Math.min(2, window.devicePixelRatio || 1), w = canvas.clientWidth, h = canvas.clientHeight;
    if (canvas.width !== Math.round(w * ratio)) canvas.width = Math.round(w * ratio);
    if (canvas.height !== Math.round(h * ratio)) canvas.height = Math.round(h * ratio);
    if (d.frames) {
      const { i, from, to, share } = framesAt(d, state.time);
      pose.set(from, to, share);
      pose.frame = i;
      if (!whom.on) pose.dyadic = null;
      face.update(pose, state.time, d.speech.agent?.[i] ?? 0, state.playing ? state.time - shown : 0);
      shown = state.time;
    }
    const clean = page.hasAttribute("data-clean");
    const covered = clean ? 0 : $("transport").offsetHeight / Math.max(1, h);
    const view = camera.at(state.time, pose, canvas.width, canvas.height, covered * 0.95);
    const fromUser = camera.fromUser && pose.user !== null;
    const sources = (d.sounds ?? []).map(({ at, seconds: [from, to] }) => ({ at, on: state.time >= from && state.time < to, age: Math.max(0, state.time - from) }));
    const lines = d.frames ? sceneLines(d, pose, {
      sources,
      fromUser, trail: trailLines(d, pieces, pose.frame), colour: timeColour(pose.frame / d.frames), joints: state.joints ? decodedAt(d, pose.frame) : null,
    }) : [];
    renderer.draw({ pose, views: [view], lines, fromUser, joints: state.joints, theme: theme() });
    const labelled = fromUser || clean ? null : view;
    hud.draw(state.time, pose, labelled, w, h);
    hud.sources(sources, clean ? null : view, w, h);
    page.dataset.sounding = sources.flatMap(({ on }, i) => (on ? [d.sounds[i].name] : [])).join(" ");
    whom.draw(pose, labelled, w, h);
    page.dataset.whom = pose.dyadic ? pose.dyadic[whom.joint ?? 0].toFixed(3) : "none";
    timeline.draw(state.time, theme());
    page.dataset.drawn = Number(page.dataset.drawn || 0) + 1;
  }

  new ResizeObserver(redraw).observe(canvas);
  matchMedia("(prefers-color-scheme: light)").addEventListener("change", redraw);
  canvas.addEventListener("webglcontextrestored", () => location.reload());
  canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());

  // Options of the address --------------------------------------------------------------------------------------------
  const number = (name, fallback) => (options.has(name) && Number.isFinite(Number(options.get(name))) ? Number(options.get(name)) : fallback);
  if (["dark", "light"].includes(options.get("theme"))) page.dataset.theme = options.get("theme");
  const cam = (options.get("cam") ?? "").split(",").map(Number);
  if ((cam.length === 3 || cam.length === 4) && cam.every(Number.isFinite)) {
    if (cam.length === 4) camera.height = clamp(cam[3], 0, 3);
    Object.assign(camera, { yaw: (cam[0] * Math.PI) / 180, pitch: (clamp(cam[1], -8, 87) * Math.PI) / 180, distance: clamp(cam[2], 0.6, 25) });
  }
  if (options.get("view") === "user") camera.fromUser = true;
  if (options.get("follow") === "0") camera.follow = false;
  if (options.get("loop") === "0") switches.loop();
  if (options.has("joints")) switches.joints();
  if (options.get("whom") === "0" && whom.on) switches.whom();
  if (d.dyadic && d.index.has(options.get("joint"))) whom.choose(d.index.get(options.get("joint")));
  if (options.has("clean")) switches.clean();
  if (options.has("help")) switches.help();
  setSpeed(number("speed", 1));
  sync();
  state.time = clamp(number("t", 0), 0, last);
  if (options.has("play") && !calm.matches) play(true);
  draw();
  page.dataset.frames = d.frames;
  if (!errors) page.dataset.state = d.frames ? "ready" : "empty";
  if (!d.frames) fail("it has no frames.");
}
