// A trap ends what the instance held, with an error, and nothing else: a module that traps in its first block.
import assert from "node:assert/strict";
import test from "node:test";
import { built } from "./load.js";

const { Core } = await import(new URL("core.js", built));
const { Link, inlinePair } = await import(new URL("link.js", built));
const { VisavisError } = await import(new URL("errors.js", built));
const { Session } = await import(new URL("session.js", built));

/** A module of one memory and one function, `visavis_poll`, of which nothing but `unreachable` is left. */
const TRAPS = Uint8Array.of(
  0x00, 0x61, 0x73, 0x6d, 1, 0, 0, 0, 1, 4, 1, 0x60, 0, 0, 3, 2, 1, 0, 5, 3, 1, 0, 1,
  7, 25, 2, 6, ...Buffer.from("memory"), 2, 0, 12, ...Buffer.from("visavis_poll"), 0, 0, 10, 5, 1, 3, 0, 0x00, 0x0b,
);

test("a trap is an error of kind fault, and the instance is not called again", async () => {
  const core = await Core.instantiate(await WebAssembly.compile(TRAPS));
  const fault = (error) => error instanceof VisavisError && error.kind === "fault" && /load the engine again/.test(error.message);
  assert.throws(() => core.call("visavis_poll"), fault);
  assert.throws(() => core.call("visavis_poll"), fault);
});

test("a fault that the worker reports ends all sessions, and each is told", async () => {
  const [port, host] = inlinePair();
  const link = new Link(port);
  host.onmessage = ({ data: { call, op } }) => {
    if (op === "session") host.postMessage({ call });
    if (op === "stats") host.postMessage({ call, error: { kind: "fault", message: "the runtime stopped" } });
  };
  const facts = { joints: [{}] };
  const sessions = [1, 2].map((id) => new Session(link, facts, id, {}));
  const told = [];
  sessions.forEach((s, i) => (s.onError = (error) => told.push([i, error.kind])));
  await Promise.all(sessions.map((s) => s.ready));
  await assert.rejects(sessions[0].stats(), { kind: "fault" });
  assert.deepEqual(told, [[0, "fault"], [1, "fault"]]);
  for (const session of sessions) assert.throws(() => session.pushUserHead(0, 1.6, 1), { kind: "fault" });
});
