// Visavis in a browser: an engine in a Worker, and sessions of it.

import { VisavisError, argument } from "./errors.js";
import { serve } from "./host.js";
import { Link, inlinePair } from "./link.js";
import { chooseModule, compile, get } from "./modules.js";
import { Session } from "./session.js";

export { VisavisError };

export const Visavis = {
  /** Loads a bundle; see index.d.ts. */
  async load(options) {
    const { bundle, wasm = {}, module, worker, inline = typeof Worker !== "function", onProgress } = options ?? {};
    given(bundle);
    const choice = chooseModule(module);
    const source = wasm[choice] ?? { relaxed: () => new URL("./visavis-relaxed.wasm", import.meta.url), simd128: () => new URL("./visavis-simd128.wasm", import.meta.url) }[choice]();
    const [bytes, code] = await Promise.all([read(bundle, onProgress), compile(source)]);
    const link = new Link(inline ? inlined() : started(worker));
    try {
      const facts = await link.ask("load", 0, [code, bytes], [bytes.buffer]);
      return new Engine(link, { ...facts, module: choice });
    } catch (error) {
      link.end(error);
      throw error;
    }
  },
};

class Engine {
  #link;
  #sessions = 0;

  constructor(link, facts) {
    this.#link = link;
    this.facts = facts;
  }

  session(options) {
    if (typeof (options ?? {}) !== "object") throw argument("options of a session: an object");
    return new Session(this.#link, this.facts, ++this.#sessions, options ?? {});
  }

  async loadFallback(bundle) {
    given(bundle);
    const bytes = await read(bundle);
    return this.#link.ask("loadFallback", 0, [bytes], [bytes.buffer]);
  }

  close() {
    this.#link.end(new VisavisError("closed", "this engine is closed: load it again"));
  }
}

function given(bundle) {
  if (bundle === undefined || bundle === null) throw argument("bundle: the URL or the bytes of a .safetensors file");
}

function inlined() {
  const [page, host] = inlinePair();
  page.terminate = serve(host);
  return page;
}

function started(worker) {
  if (typeof worker === "function") return worker();
  if (worker !== undefined) return new Worker(worker, { type: "module" });
  return new Worker(new URL("./worker.js", import.meta.url), { type: "module" });
}

/** The bundle's bytes, in memory of their own. */
async function read(bundle, onProgress) {
  if (bundle instanceof ArrayBuffer) return new Uint8Array(bundle.slice(0));
  if (ArrayBuffer.isView(bundle)) return new Uint8Array(bundle.buffer.slice(bundle.byteOffset, bundle.byteOffset + bundle.byteLength));
  if (bundle instanceof Blob) return new Uint8Array(await bundle.arrayBuffer());
  const response = bundle instanceof Response ? bundle : await get(bundle);
  const total = Number(response.headers.get("content-length")) || null;
  const parts = [];
  let loaded = 0;
  for (const reader = response.body.getReader(); ;) {
    const { done, value } = await reader.read();
    if (done) break;
    parts.push(value);
    loaded += value.length;
    onProgress?.({ loaded, total });
  }
  const bytes = new Uint8Array(loaded);
  let at = 0;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}
