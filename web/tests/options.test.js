// Options of the wrong kind are refused as errors of ours, before anything is sent; no instance is needed.
import assert from "node:assert/strict";
import test from "node:test";
import { Visavis, VisavisError, built } from "./load.js";

const { Session } = await import(new URL("session.js", built));
const link = { listen() {}, ask: () => Promise.resolve() };
const open = (options) => new Session(link, { joints: [] }, 1, options);
const ours = (error) => error instanceof VisavisError && error.kind === "argument";

test("what JSON cannot hold, or turns into a default, is refused", () => {
  for (const value of [NaN, Infinity, 10n, () => 0, Symbol("gaze"), {}, new Date()]) {
    for (const name of ["seed", "guidance", "gaze", "budget", "voiceAhead"]) assert.throws(() => open({ [name]: value }), ours, `${name} ${String(value)}`);
    assert.throws(() => open({ start: [0, value, 0] }), ours);
  }
  open({ sampler: "single", gaze: null, start: [0, 1, 0.5], guard: false, seed: undefined });
});

test("nothing at all instead of options", async () => {
  for (const options of [undefined, null, {}, 3, "bundle"]) await assert.rejects(Visavis.load(options), ours);
});
