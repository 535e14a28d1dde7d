// Engines that are closed when their test is over: the clock of one that a failed test leaves open would keep the process alive for good.
import { afterEach } from "node:test";
import { load as opened } from "./load.js";

const engines = [];
afterEach(() => engines.splice(0).forEach((engine) => engine.close()));

/** As `load` of load.js. */
export async function load(options) {
  const engine = await opened(options);
  engines.push(engine);
  return engine;
}
