// Joins the parts: what a person does, the agent, the stage, and what the page says about itself.
import { createFace, createPose, createShapes, createWebgl, css, gazeColour, add, sourceLines } from "./stage.js";
import { createAgent } from "./agent.js";
import { createVoice, decoded } from "./voice.js";
import { SOUNDS, createSounds, floorAt } from "./sounds.js";
import { createMicrophone } from "./microphone.js";
import { createUser } from "./user.js";
import { createXr } from "./xr.js";
import { createChannel, samplesOf } from "./channel.js";
import { createFigures } from "./figures.js";
import { readAssets } from "./assets.js";

const page = document.documentElement, $ = (id) => document.getElementById(id);
const options = new Map(decodeURIComponent(location.hash.slice(1)).split("&").filter(Boolean).map((part) => part.split("=", 2)));
let errors = 0;

// A sentence in place of a page that does not work.
function fail(what) {
  page.dataset.errors = ++errors;
  page.dataset.state = "error";
  $("failure").hidden = false;
  $("failure").textContent = what;
  $("welcome").hidden = true;
  $("says").textContent = "";
}
let quiet = 0;
function notice(text) {
  $("notice").hidden = false;
  $("notice").textContent = page.dataset.notice = text;
  clearTimeout(quiet);
  quiet = setTimeout(() => { $("notice").hidden = true; }, 9000);
}
const explained = (error) => error?.message ?? String(error);
window.addEventListener("error", (event) => fail(`The page has a fault: ${event.message}. Please report it.`));
window.addEventListener("unhandledrejection", (event) => fail(`The page has a fault: ${explained(event.reason)}. Please report it.`));
page.dataset.theme = options.get("theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
if (options.has("clean")) page.toggleAttribute("data-clean");
if ("serviceWorker" in navigator && location.protocol.startsWith("http") && page.dataset.worker) navigator.serviceWorker.register(page.dataset.worker).catch(() => {});

start().catch((error) => fail(explained(error)));

async function start() {
  if (typeof WebAssembly === "undefined") throw new Error("The agent cannot run: this browser has no WebAssembly, or it is switched off. A current Chrome, Edge, Firefox or Safari has it.");
  const progress = (share) => { $("done").style.width = `${Math.round(100 * share)}%`; };
  const assets = await readAssets((share, what) => { progress(0.8 * share); $("says").textContent = what; }, options.get("model"));
  const settings = { gaze: options.has("gaze") ? Number(options.get("gaze")) : 0.8, sampler: options.get("sampler") ?? "midpoint4", seed: Number(options.get("seed") ?? 1), sensitivity: 0 };
  $("says").textContent = "Starting the agent.";
  const agent = await createAgent({
    bundle: assets.bundle, wasm: assets.wasm, worker: assets.worker, ...settings,
    onError: (error) => fail(`The agent stopped: ${explained(error)} Reload the page to go on.`),
  });
  assets.bundle = null;
  progress(1);

  // The rig as the stage takes it.
  const rig = agent.facts, d = { joints: rig.joints, eyes: rig.eyes, headBack: rig.headBack, index: new Map(rig.joints.map(({ name }, j) => [name, j])), rest: [] };
  for (const { parent, offset } of rig.joints) d.rest.push(parent === null ? [...offset] : add(d.rest[parent], offset));
  const canvas = $("scene"), shapes = createShapes(d), pose = createPose(d), face = createFace(d, shapes);
  const renderer = createWebgl(canvas, d, shapes, { xrCompatible: "xr" in navigator, powerPreference: "high-performance" });
  if (!renderer) throw new Error("The agent runs, but cannot be drawn: this browser has no WebGL 2, or it is switched off. Look for \"hardware acceleration\" in its settings.");
  canvas.addEventListener("webglcontextlost", () => fail("The graphics card took the picture away. Reload the page."));

  // Sound: a context only after a gesture of the user, as browsers want it.
  let context = null;
  const openContext = () => (context ??= window.AudioContext ? new AudioContext({ latencyHint: "interactive" }) : null);
  const voice = createVoice(agent, openContext);
  const user = createUser(canvas);
  const sounds = createSounds(agent, user, openContext);
  const figures = createFigures({ agent, renderer, settings, state: () => page.dataset });
  let over = 0, avatar = null;
  const microphone = createMicrophone(openContext, (samples, rate, level) => hear(samples, rate, level));

  function hear(samples, rate, level) {
    agent.session.pushUserVoice(samples, rate);
    over = level > 0.04 ? over + samples.length / rate : 0;
    if ($("barge").checked && over > 0.25 && voice.speaking()) interrupt();
  }
  async function say(samples, rate, name) {
    $("interrupt").disabled = false;
    return voice.say(samples, rate, name);
  }
  function interrupt() {
    if (voice.interrupt()) page.dataset.interrupted = Number(page.dataset.interrupted ?? 0) + 1;
  }
  function setGaze(value) {
    settings.gaze = value === null ? null : Math.min(1, Math.max(0, value));
    agent.session.setGaze(settings.gaze);
    $("free").checked = settings.gaze === null;
    if (settings.gaze !== null) $("gaze").value = settings.gaze;
    $("target").textContent = settings.gaze === null ? "free" : settings.gaze.toFixed(2);
  }

  function setSensitivity(value) {
    settings.sensitivity = Math.min(1, Math.max(-1, value));
    agent.session.setSensitivity(settings.sensitivity);
    $("sensitivity").value = settings.sensitivity;
    $("minds").textContent = ["dull", "neutral", "sensitive"].find((_, i) => Math.abs(settings.sensitivity - (i - 1)) < 0.05) ?? settings.sensitivity.toFixed(1);
  }
  // The sound that a click on the floor puts there, or null.
  let armed = null, seen = null;
  function arm(name) {
    armed = name;
    for (const button of $("sounds").children) button.setAttribute("aria-pressed", button.dataset.name === name);
    page.toggleAttribute("data-armed", name !== null);
  }
  async function drop(what, at, rate) {
    if (!agent.facts.hasHearing) throw new Error(deaf());
    await sounds.drop(what, at, rate);
    page.dataset.dropped = Number(page.dataset.dropped ?? 0) + 1;
  }
  const hearing = assets.models.find(({ hears }) => hears);
  const deaf = () => `${agent.facts.name} hears both voices, not the room: sounds need a model with hearing${hearing ? `, such as ${hearing.name}` : ""}`;
  // Two metres behind it, a little to the side.
  const behind = () => [root.x - 2 * Math.sin(root.yaw + 0.3), undefined, root.z - 2 * Math.cos(root.yaw + 0.3)];

  // Another model makes the motion from here on, where the agent stands.
  async function become(bundle) {
    interrupt();
    sounds.clear();
    const options = () => ({ ...settings, start: [root.x, root.z, root.yaw] });
    await agent.become(bundle, options).catch((error) => {
      // Without a student network there is no single step.
      if (settings.sampler !== "single" || error.kind !== "argument") throw error;
      settings.sampler = $("sampler").value = "midpoint4";
      return agent.become(bundle, options);
    });
    introduce();
    figures.restart();
  }
  // Who it is, for people and scripts.
  function introduce() {
    const { kind, name, module, hasHearing } = agent.facts;
    Object.assign(page.dataset, { module, model: name, kind, hearing: hasHearing });
    $("room").hidden = !hasHearing;
    $("deaf").hidden = hasHearing;
    $("deaf").textContent = `${deaf()}.`;
    if (!hasHearing) arm(null);
    $("whom").hidden = kind !== "dram";
    $("sampling").hidden = kind === "dram";
  }

  // What a person can press ----------------------------------------------------------------------------------------------
  const press = (id, on) => $(id).setAttribute("aria-pressed", on);
  const acts = {
    async microphone() {
      try {
        if (microphone.on) microphone.stop(); else await microphone.start();
      } catch (error) {
        notice(explained(error));
      }
      press("microphone", microphone.on);
      $("microphone").querySelector("span").textContent = microphone.on ? "It hears you" : "Talk to it";
      page.dataset.microphone = microphone.on ? "on" : "off";
    },
    interrupt,
    outside() {
      user.outside = !user.outside;
      // From the side, so that neither hides the other.
      user.orbit.yaw = Math.atan2(user.position[0] - root.x, user.position[2] - root.z) + 1.2;
      press("outside", user.outside);
    },
    sound() { if (agent.facts.hasHearing) drop(armed ?? SOUNDS[0], behind()); else notice(`No sound: ${deaf()}.`); },
    theme() { page.dataset.theme = page.dataset.theme === "dark" ? "light" : "dark"; },
    more() { if ($("more").open) $("more").close(); else { figures.show(); $("more").showModal(); } },
    async report() {
      const text = await figures.report();
      page.dataset.report = text;
      try { await navigator.clipboard.writeText(text); notice("The report is in the clipboard."); } catch { notice(text); }
    },
    "own-body"() { avatar?.dispose(); avatar = null; $("own-body").hidden = true; page.dataset.avatar = ""; },
  };
  for (const id of ["microphone", "interrupt", "outside", "theme", "report", "own-body"]) $(id).addEventListener("click", acts[id]);
  for (const id of ["open-more", "close-more"]) $(id).addEventListener("click", acts.more);
  $("gaze").addEventListener("input", () => setGaze(Number($("gaze").value)));
  $("free").addEventListener("change", () => setGaze($("free").checked ? null : Number($("gaze").value)));
  $("sensitivity").addEventListener("input", () => setSensitivity(Number($("sensitivity").value)));
  for (const name of SOUNDS) {
    const button = Object.assign(document.createElement("button"), { textContent: name, title: `Then click on the floor: ${name}` });
    button.dataset.name = name;
    button.addEventListener("click", () => arm(armed === name ? null : name));
    $("sounds").append(button);
  }
  arm(null);
  // A press that does not move puts the chosen sound there; what moves walks around.
  let pressed = null;
  canvas.addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; });
  canvas.addEventListener("pointerup", (event) => {
    if (!armed || !pressed || !seen || xr.mode || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 6) return;
    const box = canvas.getBoundingClientRect();
    const at = floorAt(seen, (2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height, [root.x, root.z]);
    if (at) drop(armed, at).catch((error) => notice(`No sound: ${explained(error)}.`));
    else notice("That is above the floor: click on the floor.");
  });
  $("sampler").value = settings.sampler;
  $("sampler").addEventListener("change", () => { settings.sampler = $("sampler").value; agent.session.setSampler(settings.sampler).catch((error) => notice(`No other sampler: ${explained(error)}`)); figures.restart(); });
  for (const { name, kind, hears } of assets.models) $("model").append(new Option(kind === "dram" ? `${name} (featherweight)` : hears ? `${name} (hears the room)` : name));
  $("choose").hidden = assets.models.length < 2;
  let chosen = $("model").selectedIndex = assets.first;
  $("model").addEventListener("change", async () => {
    const wanted = $("model").selectedIndex, busy = (text) => { $("busy").textContent = text; };
    $("model").disabled = true;
    busy("Loading.");
    try {
      await become(await assets.model(wanted, (_, what) => busy(what)));
      chosen = wanted;
    } catch (error) {
      notice(`No other model: ${explained(error)}`);
    }
    $("model").selectedIndex = chosen;
    $("model").disabled = false;
    busy("");
  });
  assets.lines.forEach(({ name, samples, rate }, i) => {
    const button = Object.assign(document.createElement("button"), { textContent: name, title: `Let it say this (${i + 1})` });
    button.addEventListener("click", () => say(samples, rate, name));
    $("lines").append(button);
  });
  const keys = { m: acts.microphone, x: interrupt, b: acts.sound, v: acts.outside, t: acts.theme, "?": acts.more };
  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat || event.target.closest?.("input, select, dialog")) return;
    if (/^[1-9]$/.test(event.key)) $("lines").children[Number(event.key) - 1]?.click();
    else keys[event.key.toLowerCase()]?.();
  });

  // Files ------------------------------------------------------------------------------------------------------------------
  async function take(file) {
    try {
      const bytes = await file.arrayBuffer();
      if (file.name.endsWith(".safetensors")) {
        await become(bytes);
        $("model").selectedIndex = chosen = -1;
        return notice(`${agent.facts.name} makes the motion now.`);
      }
      const magic = new TextDecoder().decode(bytes.slice(0, 4));
      if (magic !== "glTF") {
        const { samples, rate } = await decoded(bytes).catch(() => { throw new Error("it is no sound that this browser decodes, and no VRM"); });
        await say(samples, rate, file.name);
        return notice(`It says ${file.name}.`);
      }
      notice(`Loading ${file.name}.`);
      const { createAvatar } = await assets.avatars();
      const next = await createAvatar(bytes, { canvas, gl: renderer.gl, rig });
      avatar?.dispose();
      avatar = next;
      $("own-body").hidden = false;
      page.dataset.avatar = avatar.name;
      notice(`${avatar.name} has the body now: ${avatar.bones} of ${rig.joints.length} bones.`);
    } catch (error) {
      notice(`${file.name} cannot be used: ${explained(error)}.`);
    }
  }
  window.addEventListener("dragover", (event) => { event.preventDefault(); page.dataset.over = ""; });
  window.addEventListener("dragleave", () => delete page.dataset.over);
  window.addEventListener("drop", (event) => { event.preventDefault(); delete page.dataset.over; for (const file of event.dataTransfer.files) take(file); });
  $("file").addEventListener("change", () => { for (const file of $("file").files) take(file); $("more").close(); });

  createChannel({
    say: async (m) => { const s = m.file ? await decoded(m.file) : null; await say(...(s ? [s.samples, s.rate] : samplesOf(m)), "another program"); },
    hear: (m) => hear(...samplesOf(m), 0),
    interrupt,
    gaze: ({ value }) => { if (value !== null && !(value >= 0 && value <= 1)) throw new Error("gaze is 0 to 1, or null"); setGaze(value); },
    async sound({ name, samples, rate, at }) {
      if (!Array.isArray(at) || at.length !== 3 || !at.every(Number.isFinite)) throw new Error("at is where the sound is: x, y, z in metres");
      if (samples === undefined && !SOUNDS.includes(name)) throw new Error(`there is no sound "${name}"; there are ${SOUNDS.join(", ")}`);
      await drop(...(samples === undefined ? [name, at] : [samplesOf({ samples, rate })[0], at, rate]));
    },
    sensitivity({ value }) {
      if (!(value >= -1 && value <= 1)) throw new Error("sensitivity is -1 (dull) to 1 (sensitive)");
      setSensitivity(value);
    },
    state: () => ({ ...page.dataset }),
  });

  // Headsets ---------------------------------------------------------------------------------------------------------------
  let root = { x: 0, z: 0, yaw: 0 };
  const xr = createXr(renderer.gl, {
    agentRoot: () => root,
    frame: (time, views, framebuffer, seeThrough) => draw(time, views, framebuffer, seeThrough),
    onHead(position, rotation) { Object.assign(user, { position, rotation }); tell(); },
    onGaze: (step) => setGaze(step === null ? null : (settings.gaze ?? 0.5) + step),
    onInterrupt: interrupt,
    onChange() {
      user.inHeadset = xr.mode !== null;
      page.dataset.mode = xr.mode ?? "screen";
      for (const mode of ["vr", "ar"]) $(mode).textContent = xr.mode === mode ? "Leave" : `Enter ${mode.toUpperCase()}`;
      if (!xr.mode) { user.position[1] = 1.65; requestAnimationFrame(loop); }
    },
  });
  const offered = async () => { const offers = await xr.look(); for (const mode of ["vr", "ar"]) $(mode).hidden = !offers[mode]; };
  for (const mode of ["vr", "ar"]) $(mode).addEventListener("click", () => xr.enter(xr.mode === mode ? null : mode).catch((error) => notice(`No ${mode.toUpperCase()}: ${explained(error)}.`)));
  navigator.xr?.addEventListener?.("devicechange", offered);
  await offered();

  // The picture ------------------------------------------------------------------------------------------------------------
  let before = performance.now(), ratio = Number(options.get("pixels")) || Math.min(2, window.devicePixelRatio || 1), slow = 0, drawn = 0;
  const tell = () => agent.session.pushUserHead(...user.position, undefined, user.rotation);

  // Where the frame time is over what 60 a second allow for two seconds, fewer pixels are drawn.
  function adapt(seconds) {
    slow = seconds > 1 / 45 && seconds < 0.5 ? slow + 1 : Math.max(0, slow - 2);
    if (slow > 90 && ratio > 0.75) [ratio, slow] = [Math.max(0.75, ratio * 0.8), 0];
  }

  function loop(now) {
    if (xr.mode) return;
    requestAnimationFrame(loop);
    const seconds = Math.min(0.2, (now - before) / 1000), w = canvas.clientWidth, h = canvas.clientHeight;
    adapt((now - before) / 1000);
    if (canvas.width !== Math.round(w * ratio)) canvas.width = Math.round(w * ratio);
    if (canvas.height !== Math.round(h * ratio)) canvas.height = Math.round(h * ratio);
    user.update([root.x, 0, root.z], seconds);
    const covered = page.hasAttribute("data-clean") ? 0 : $("desk").offsetHeight / Math.max(1, h);
    seen = user.view(pose, canvas.width, canvas.height, covered * 0.9, seconds);
    draw(now, [seen], null, false);
  }

  function draw(now, views, framebuffer, seeThrough) {
    const seconds = (now - before) / 1000;
    before = now;
    const moment = agent.at(), level = voice.level();
    pose.set(moment.from, moment.to, moment.share);
    root = { x: pose.root[0], z: pose.root[2], yaw: moment.from.yaw };
    pose.user = user.position;
    if (!user.inHeadset && pose.eyes) user.face(pose.eyes);
    if (!$("dyadic").checked) pose.dyadic = null;
    face.update(pose, agent.now(), level, seconds);
    for (const view of views) view.target ??= pose.root;
    const outside = user.outside && !xr.mode;
    sounds.listen();
    const lines = [...(outside ? window_lines() : []), ...sourceLines(sounds.shown())];
    renderer.draw({ pose, views, lines, theme: page.dataset.theme, fromUser: !outside, backdrop: true, place: [0, 0, 0], seeThrough, bodiless: avatar !== null, framebuffer });
    if (avatar) {
      avatar.pose(pose, moment.from.local, face, seconds);
      avatar.draw(views, framebuffer);
    }
    figures.frame(seconds, moment.late);
    drawn++;
  }
  const window_lines = () => [{ from: [user.position[0], 0.006, user.position[2]], to: add(user.position, [0, -0.14, 0]), width: 0.006, c0: [0.75, 0.47, 0.89, 0.8], c1: [0.75, 0.47, 0.89, 0.15], flat: false }];

  const mean = (shares) => (shares ? (shares.reduce((sum, x) => sum + x, 0) / shares.length).toFixed(3) : "");

  // In words for people, in data for scripts.
  function inform() {
    const moment = agent.at(), gaze = moment.from.gaze, saying = voice.saying(), speaking = voice.speaking(), data = page.dataset, p = user.position;
    const { calls, triangles } = renderer.counts();
    Object.assign(data, {
      frames: Math.round(agent.computed() * 30), drawn, speaking, mouth: face.open.toFixed(2), gaze: Number.isNaN(gaze) ? "" : gaze.toFixed(3), dyadic: mean(moment.from.dyadic), calls, triangles, sounding: sounds.sounding().join(" "),
      root: `${root.x.toFixed(3)},${root.z.toFixed(3)}`, yaw: root.yaw.toFixed(4), user: p.map((x) => x.toFixed(3)).join(","), bearing: Math.atan2(p[0] - root.x, p[2] - root.z).toFixed(4),
    });
    $("interrupt").disabled = !speaking;
    $("level").style.setProperty("--level", Math.min(1, microphone.level * 5).toFixed(2));
    $("scored").textContent = Number.isNaN(gaze) ? "–" : gaze.toFixed(2);
    $("score").style.background = Number.isNaN(gaze) ? "" : css(gazeColour(gaze));
    for (const button of $("lines").children) button.dataset.on = saying === button.textContent;
    const says = !moment.from.index && !agent.computed() ? "Starting." : armed ? `Click on the floor: there is the ${armed}.` : speaking ? "It is speaking." : microphone.on ? (microphone.level > 0.02 ? "It hears you." : "It listens.") : "Walk around it, let it speak, or talk to it.";
    if ($("says").textContent !== says) $("says").textContent = says;
  }

  // At rates of their own, however long a picture takes; a headset tells its pose itself.
  setInterval(() => user.inHeadset || tell(), 1000 / 60);
  setInterval(() => { voice.keep(context); inform(); }, 100);
  setGaze(settings.gaze);
  if (options.has("outside")) acts.outside();
  for (const [name, k] of [["x", 0], ["z", 2]]) if (options.has(name)) user.position[k] = Number(options.get(name));
  $("welcome").hidden = true;
  $("desk").hidden = false;
  introduce();
  setSensitivity(0);
  page.dataset.mode = "screen";
  requestAnimationFrame(loop);
  // For scripts in this window; other windows send messages (channel.js).
  window.visavisLive = { agent, voice, user, sounds, drop, xr, take, say, interrupt, setGaze, pose, face, behind: () => context && voice.behind(context) };
  if (!errors) page.dataset.state = "ready";
}
