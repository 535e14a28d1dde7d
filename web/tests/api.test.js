// What the package promises to a page, in Node.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
import { load } from "./closing.js";
import { Visavis, VisavisError, root } from "./load.js";
import { fill } from "./scene.js";

const kind = (wanted, part) => (error) => {
  assert.ok(error instanceof VisavisError, `${error}`);
  assert.equal(error.kind, wanted, error.message);
  if (part) assert.match(error.message, part);
  return true;
};

test("an engine tells what it is", async () => {
  const { facts, close } = await load();
  assert.equal(facts.fps, 30);
  assert.equal(facts.blockFrames, 4);
  assert.equal(facts.joints[0].name, "hips");
  assert.equal(facts.joints[0].parent, null);
  assert.match(facts.level, /simd128|relaxed/);
  void close;
});

test("bundles that are none are refused, and say why", async () => {
  await assert.rejects(load({ bundle: new Uint8Array(9) }), kind("bundle-corrupt"));
  const cut = readFileSync(new URL("tests/goldens/tiny.safetensors", root));
  await assert.rejects(load({ bundle: cut.subarray(0, cut.length / 2) }), kind("bundle-corrupt"));
  await assert.rejects(Visavis.load({}), kind("argument", /bundle/));
  await assert.rejects(Visavis.load({ bundle: "file:///nowhere/at.all" }), kind("io", /nowhere/));
  await assert.rejects(load({ module: "best" }), kind("argument", /relaxed/));
});

test("a bundle may be bytes, a view, a blob, a response or an address, and reports its progress", async () => {
  const address = new URL("tests/goldens/tiny.safetensors", root);
  const bytes = readFileSync(address);
  const last = [];
  for (const bundle of [bytes, new Blob([bytes]), new Response(bytes), address, address.href]) {
    const engine = await Visavis.load({ bundle, onProgress: ({ loaded }) => last.push(loaded) });
    engine.close();
  }
  assert.equal(last.at(-1), bytes.length);
});

test("frames come in order, in metres and unit quaternions", async () => {
  const engine = await load();
  const session = engine.session({ clock: "manual", sampler: "midpoint2", gaze: 0.8 });
  const frames = [];
  session.onFrames = (four) => frames.push(...four);
  fill(session, 30);
  await session.advance(2);
  assert.equal(frames.length, 60);
  frames.forEach((f, i) => {
    assert.equal(f.index, i);
    assert.ok(Math.abs(f.time - i / 30) < 1e-9);
    assert.equal(f.sampler, "midpoint2");
    assert.equal(f.joints.length, 11 * engine.facts.joints.length);
    for (let j = 0; j < f.joints.length; j += 11) {
      for (const at of [j, j + 7]) assert.ok(Math.abs(Math.hypot(...f.joints.subarray(at, at + 4)) - 1) < 1e-4);
    }
  });
  assert.ok(frames.every((f) => f.gaze >= -1 && f.gaze <= 1));
  const shown = session.shown();
  assert.ok(Math.abs(shown.frame.time - (2 - 4 / 30)) < 1.01 / 30, `${shown.frame.time}`);
  const stats = await session.stats();
  assert.equal(stats.blocks, 15);
  assert.ok(stats.blockMs.p50 > 0 && stats.memoryBytes > 0 && stats.head.accepted > 0);
  engine.close();
});

test("while nobody knows where the user is, there is no gaze score", async () => {
  const engine = await load();
  const session = engine.session({ clock: "manual", sampler: "single" });
  let frames;
  session.onFrames = (four) => (frames = four);
  await session.advance(0.1);
  assert.deepEqual(frames.map((f) => f.gaze), [null, null, null, null]);
  engine.close();
});

test("bundles of the kind dram see the head's rotation and tell whom the joints follow; others do neither", async () => {
  const motion = async (bundle, rotation) => {
    const engine = await load({ bundle });
    const session = engine.session({ clock: "manual", sampler: "midpoint1" });
    const frames = [];
    session.onFrames = (four) => frames.push(...four);
    for (let n = 0; n < 60; n++) session.pushUserHead(0.3, 1.6, 1.2, n / 30, rotation);
    await session.advance(2);
    const { head } = await session.stats();
    engine.close();
    return { kind: engine.facts.kind, joints: engine.facts.joints.length, frames, head, bits: Buffer.concat(frames.map((f) => Buffer.from(f.joints.slice().buffer))) };
  };
  const away = Float32Array.of(0, 0, 0, 1);
  const [seen, unseen] = [await motion("tests/goldens/dram-tcn.safetensors", away), await motion("tests/goldens/dram-tcn.safetensors", null)];
  assert.equal(seen.kind, "dram");
  assert.ok(seen.frames.length >= 60 && seen.frames.every(({ dyadic }) => dyadic.length === seen.joints && dyadic.every((share) => share >= 0 && share <= 1)));
  assert.ok(seen.frames.some(({ dyadic }) => dyadic.some((share) => share > 0)));
  assert.ok(!seen.bits.equals(unseen.bits));
  const [one, other] = [await motion("tests/goldens/tiny.safetensors", [...away]), await motion("tests/goldens/tiny.safetensors")];
  assert.equal(one.kind, "sarah");
  assert.ok(one.frames.every(({ dyadic }) => dyadic === null));
  assert.ok(one.bits.equals(other.bits));
  const broken = await motion("tests/goldens/dram-tcn.safetensors", [0, NaN, 0, 1]);
  assert.equal(broken.head.nonFinite, 60);
  const engine = await load();
  const session = engine.session({ clock: "manual" });
  for (const rotation of [[0, 0, 1], "up", 1, [0, 0, 0, "1"]]) assert.throws(() => session.pushUserHead(0, 1.6, 1, 0, rotation), kind("argument", /rotation/));
  engine.close();
});

test("late blocks are left to the fallback, whose frames tell whom the joints follow", async () => {
  const engine = await load();
  const light = readFileSync(new URL("tests/goldens/dram-tcn.safetensors", root));
  const session = engine.session({ clock: "manual", budget: 100 });
  await assert.rejects(session.setFallback(), kind("state", /loadFallback/));
  await assert.rejects(engine.loadFallback(), kind("argument", /bundle/));
  await assert.rejects(engine.loadFallback(light.subarray(0, 99)), kind("bundle-corrupt"));
  await engine.loadFallback(readFileSync(new URL("tests/goldens/tiny.safetensors", root)));
  await assert.rejects(session.setFallback(), kind("argument", /dram/));
  const facts = await engine.loadFallback(light);
  assert.equal(facts.kind, "dram");
  await session.setFallback();
  let fell = 0, told = false;
  session.onFrames = (frames) => {
    told = frames.every(({ dyadic }) => dyadic?.length === facts.joints.length);
    assert.ok(told || frames.every(({ dyadic }) => dyadic === null));
    fell += told;
  };
  for (let block = 0; block < 60; block++) {
    // A little less than a block, so that sums of it do not reach into the next.
    await session.advance(0.1333);
    await session.reportBlockTime(told ? 5 : 99999);
  }
  const { blocks, governor } = await session.stats();
  assert.equal(blocks, 60);
  assert.ok(fell > 0);
  assert.equal(governor.fallbackBlocks, fell);
  assert.equal(governor.heldBlocks, 0);
  await assert.rejects(session.reportBlockTime(-1), kind("argument"));
  assert.throws(() => session.reportBlockTime(NaN), kind("argument"));
  engine.close();
  await assert.rejects(engine.loadFallback(light), kind("closed"));
});

test("sounds in the room are heard where the bundle has hearing, at their place", async () => {
  const engine = await load({ bundle: "tests/goldens/hearing.safetensors" });
  assert.equal(engine.facts.hasHearing, true);
  const bang = Float32Array.from({ length: 9600 }, (_, i) => ((i * 7919) % 2000 - 1000) / 125);
  const motion = async (push, options = {}) => {
    const session = engine.session({ clock: "manual", ...options });
    const frames = [];
    session.onFrames = (four) => frames.push(...four);
    push(session);
    await session.advance(0.5);
    const { sounds } = await session.stats();
    session.close();
    return { bits: Buffer.concat(frames.map((f) => Buffer.from(f.joints.slice().buffer))), sounds };
  };
  const beside = (x) => (session) => session.pushSound(7, bang, 24000, [x, 1, -2]);
  const heard = await motion(beside(1));
  assert.deepEqual([heard.sounds.pieces, heard.sounds.started, heard.sounds.refused], [1, 1, 0]);
  const pieces = await motion((session) => [0, 1, 2].forEach((i) => session.pushSound(7, bang.subarray(3200 * i, 3200 * (i + 1)), 24000, Float32Array.of(1, 1, -2))));
  assert.ok(heard.bits.equals(pieces.bits));
  const others = [
    await motion(() => {}), await motion(beside(-1)), await motion(beside(1), { sensitivity: 1 }), await motion((session) => { beside(1)(session); session.endSound(7); }),
    await motion((session) => { session.setSensitivity(-1); beside(1)(session); }),
    await motion((session) => session.pushEars(bang, bang.map((v) => v / 2), 24000)), await motion((session) => session.pushEars(bang.map((v) => v / 2), bang, 24000)),
  ];
  for (const other of others) assert.ok(!heard.bits.equals(other.bits));

  const session = engine.session({ clock: "manual" });
  for (const id of [-1, 1.5, 2 ** 32, "1", null]) assert.throws(() => session.pushSound(id, bang, 24000, [0, 1, 2]), kind("argument", /number of a sound/));
  for (const place of [null, [0, 1], "here", [0, 1, "2"]]) assert.throws(() => session.pushSound(1, bang, 24000, place), kind("argument", /three numbers/));
  assert.throws(() => session.pushSound(1, [0, 1], 24000, [0, 1, 2]), kind("argument", /Float32Array/));
  assert.throws(() => session.pushSound(1, bang, 0, [0, 1, 2]), kind("audio", /8000/));
  assert.throws(() => session.pushEars(bang, bang.subarray(1), 24000), kind("argument", /as many of both/));
  assert.throws(() => session.pushEars(bang, [0, 1], 24000), kind("argument", /Float32Array/));
  session.endEars();
  for (const value of [1.6, NaN, "1"]) assert.throws(() => session.setSensitivity(value), kind("argument", /sensitivity/));
  await assert.rejects(engine.session({ sensitivity: -2 }).ready, kind("argument", /sensitivity/));
  const told = [];
  session.onError = (error) => told.push(error.kind);
  session.pushSound(1, bang, 24000, [NaN, 1, 2]);
  session.pushSound(1, Float32Array.of(0, NaN, 99), 24000, [0, 1, 2]);
  for (let id = 2; id < 102; id++) session.pushSound(id, bang, 24000, [0, 1.6, 0]);
  await session.advance(0.5);
  const { sounds, blocks } = await session.stats();
  assert.deepEqual(told, ["argument", "audio"]);
  assert.equal(blocks, 4);
  assert.deepEqual([sounds.badPlaces, sounds.nonFiniteSamples, sounds.clippedSamples], [1, 1, 1]);
  assert.ok(sounds.refused >= 84, `${sounds.refused}`);
  engine.close();

  const deaf = await load();
  assert.equal(deaf.facts.hasHearing, false);
  const without = deaf.session({ clock: "manual" });
  assert.throws(() => without.pushSound(1, bang, 24000, [0, 1, 2]), kind("argument", /hearing/));
  assert.throws(() => without.endSound(1), kind("argument", /hearing/));
  assert.throws(() => without.pushEars(bang, bang, 24000), kind("argument", /hearing/));
  assert.throws(() => without.endEars(), kind("argument", /hearing/));
  without.setSensitivity(1);
  await without.advance(0.2);
  deaf.close();
});

test("an agent tells where it takes a sound to be, until it forgets", async () => {
  const engine = await load({ bundle: "tests/goldens/hearing.safetensors" });
  const bang = Float32Array.from({ length: 9600 }, (_, i) => ((i * 7919) % 2000 - 1000) / 125);
  const blocks = (session, count) => session.advance((count * 4) / 30);
  const session = engine.session({ clock: "manual", sampler: "single" });
  await blocks(session, 1.5);
  assert.equal(await session.heardPlace(), null);
  session.pushSound(5, bang, 24000, [1, 1.25, -2]);
  assert.equal(await session.heardPlace(), null, "no block has heard it");
  await blocks(session, 3);
  assert.deepEqual(await session.heardPlace(), [1, 1.25, -2]);
  // 0.4 s of some 100 dB, which fade by 45 dB a second to 35 dB; then two seconds.
  await blocks(session, 16);
  assert.deepEqual(await session.heardPlace(), [1, 1.25, -2]);
  await blocks(session, 16);
  assert.equal(await session.heardPlace(), null, "it is forgotten");
  session.pushSound(5, bang, 24000, [-1, 1.25, -2]);
  await blocks(session, 3);
  assert.deepEqual(await session.heardPlace(), [-1, 1.25, -2]);
  await session.reset();
  assert.equal(await session.heardPlace(), null);

  // Of two microphones one hears first and louder: it comes from that side of the head.
  let state = 1;
  const near = Float32Array.from({ length: 9600 }, () => ((state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32 - 0.5) * 0.6);
  const far = near.map((_, i) => (i < 9 ? 0 : 0.7 * near[i - 9]));
  const head = 11 * engine.facts.joints.findIndex(({ name }) => name === "head");
  for (const side of [1, -1]) {
    await session.reset();
    let frames;
    session.onFrames = (four) => (frames = four);
    session.pushEars(...(side > 0 ? [near, far] : [far, near]), 24000);
    await blocks(session, 0.5);
    const [px, , pz, qx, qy, qz, qw] = frames[3].joints.subarray(head + 4, head + 11);
    await blocks(session, 1);
    const [x, y, z] = await session.heardPlace();
    // The head's X axis, which points to the left, along the floor.
    const left = ((1 - 2 * (qy * qy + qz * qz)) * (x - px) + 2 * (qx * qz - qw * qy) * (z - pz)) / Math.hypot(x - px, z - pz);
    assert.ok(side * left > 0.3, `${left}`);
    assert.equal(y, 1.5);
  }
  session.close();
  await assert.rejects(session.heardPlace(), kind("closed"));
  engine.close();

  const deaf = await load();
  const without = deaf.session({ clock: "manual", sampler: "single" });
  await blocks(without, 2);
  assert.equal(await without.heardPlace(), null);
  deaf.close();
});

test("in real time a block comes every 133 ms, pauses stop it", async () => {
  const engine = await load();
  const session = engine.session({ sampler: "single" });
  await session.ready;
  const seen = [];
  await new Promise((resolve) => {
    session.onFrames = (frames) => seen.push(frames[0].time) >= 4 && resolve();
  });
  assert.deepEqual(seen.map((t) => Math.round(t * 30)), [0, 4, 8, 12]);
  assert.ok(session.time >= 0.4, `${session.time}`);
  session.pause();
  const paused = session.time;
  await new Promise((resolve) => setTimeout(resolve, 300));
  assert.equal(session.time, paused);
  const count = seen.length;
  assert.ok(count <= 5, `${count} blocks`);
  await session.resume();
  await new Promise((resolve) => {
    session.onFrames = resolve;
  });
  engine.close();
});

test("the agent's voice tells when it is heard, and can be broken off", async () => {
  const engine = await load();
  const session = engine.session({ clock: "manual" });
  const second = new Float32Array(24000).fill(0.1);
  assert.equal(await session.pushAgentVoice(second, 24000), 0);
  assert.equal(await session.pushAgentVoice(second, 24000), 1);
  await session.advance(0.5);
  session.interrupt();
  const starts = await session.pushAgentVoice(second, 24000);
  assert.ok(Math.abs(starts - 16 / 30) < 1e-6, `${starts}`);
  engine.close();
});

test("what is wrong is refused with its kind, what is only odd is counted", async () => {
  const engine = await load();
  await assert.rejects(engine.session({ sampler: "best" }).ready, kind("argument", /midpoint4/));
  await assert.rejects(engine.session({ colour: 1 }).ready, kind("argument", /colour/));
  await assert.rejects(engine.session({ voiceAhead: 0.4 }).ready, kind("argument", /0\.5 to 60/));
  const brief = engine.session({ clock: "manual", voiceAhead: 0.5 });
  await brief.pushAgentVoice(new Float32Array(24000), 24000);
  assert.equal((await brief.stats()).agentVoice.overflowSamples, 12000);
  brief.close();
  assert.throws(() => engine.session({ clock: "sun" }), kind("argument"));
  assert.throws(() => engine.session({ gaze: "much" }), kind("argument"));
  const session = engine.session({ clock: "manual" });
  assert.throws(() => session.pushUserVoice([0, 1], 48000), kind("argument", /Float32Array/));
  assert.throws(() => session.pushUserVoice(new Float32Array(4), 7), kind("audio", /8000/));
  assert.throws(() => session.pushUserVoice(new Float32Array(4), NaN), kind("audio"));
  assert.throws(() => session.pushUserVoice(new Float32Array(8000 * 61), 8000), kind("audio", /minute/));
  assert.throws(() => session.pushUserHead("1", 0, 0), kind("argument"));
  assert.throws(() => session.setGaze(1.5), kind("argument", /-1 to 1/));
  assert.throws(() => session.clearVoice("nobody"), kind("argument"));
  await assert.rejects(session.setSampler("worst"), kind("argument"));
  await assert.rejects(session.setBudget(-1), kind("argument"));
  await assert.rejects(session.advance(-1), kind("argument"));
  session.pushUserHead(NaN, 1.6, 1, 0);
  session.pushUserHead(Infinity, 1.6, 1, 0);
  let told = null;
  session.onError = (error) => (told = error);
  session.pushUserVoice(Float32Array.of(0, NaN, 0, Infinity), 48000);
  await session.advance(0.2);
  const stats = await session.stats();
  assert.equal(stats.head.nonFinite, 2);
  assert.equal(stats.userVoice.nonFiniteSamples, 2);
  kind("audio")(told);
  session.close();
  assert.throws(() => session.pushUserHead(0, 1.6, 1), kind("closed"));
  await assert.rejects(session.stats(), kind("closed"));
  engine.close();
  await assert.rejects(engine.session().ready, kind("closed"));
});

for (const bundle of ["tiny", "hearing"]) {
  test(`any values at all, ${bundle}: an error of ours or none, and the session goes on`, async () => {
    const engine = await load({ bundle: `tests/goldens/${bundle}.safetensors` });
    const session = engine.session({ clock: "manual", sampler: "single" });
    session.onError = (error) => assert.ok(error instanceof VisavisError && error.kind !== "fault", `${error}`);
    const odd = [NaN, Infinity, -Infinity, 0, -0, 1e308, -1e308, 5e-324, 1.5, 2 ** 53, -1, null, undefined, "", "agent", {}, [], true, 10n, new Float32Array(3), () => 0];
    let state = 7;
    const pick = () => odd[(state = (Math.imul(state, 1664525) + 1013904223) >>> 0) % odd.length];
    const calls = ["pushUserHead", "pushUserVoice", "pushAgentVoice", "finishVoice", "clearVoice", "setVoicePresent", "setGaze", "setSampler", "setBudget", "setFallback", "reportBlockTime", "pushSound", "endSound", "pushEars", "endEars", "heardPlace", "setSensitivity"];
    for (let i = 0; i < 3000; i++) {
      try {
        await session[calls[i % calls.length]](pick(), pick(), pick(), pick());
      } catch (error) {
        assert.ok(error instanceof VisavisError && error.kind !== "fault", `${calls[i % calls.length]}: ${error.stack}`);
      }
    }
    const before = (await session.stats()).blocks;
    await session.advance(1);
    assert.ok((await session.stats()).blocks > before);
    engine.close();
  });
}

test("memory is flat over an hour of motion", async () => {
  const engine = await load();
  const session = engine.session({ clock: "manual", sampler: "single" });
  const minute = new Float32Array(60 * 8000).fill(0.01);
  const memory = [];
  for (let i = 0; i < 60; i++) {
    session.pushUserVoice(minute, 8000);
    for (let n = 0; n < 60; n++) session.pushUserHead(Math.sin(n), 1.6, 1.5, session.time + n);
    await session.advance(60);
    memory.push((await session.stats()).memoryBytes);
  }
  assert.equal(memory.at(-1), memory[1], memory.join(" "));
  engine.close();
});

test("sessions leave nothing behind", async () => {
  const engine = await load();
  const memory = [];
  for (let i = 0; i < 200; i++) {
    const session = engine.session({ clock: "manual", sampler: "single" });
    await session.advance(0.2);
    memory.push((await session.stats()).memoryBytes);
    session.close();
  }
  assert.equal(memory.at(-1), memory[10]);
  engine.close();
});
