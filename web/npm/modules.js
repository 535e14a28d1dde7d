// Which of the two modules this engine can run: one with instructions that it does not know does not validate as a whole.

import { VisavisError, named } from "./errors.js";

// A function with nothing but one instruction on a local vector.
const probe = (body) => new Uint8Array([
  0x00, 0x61, 0x73, 0x6d, 1, 0, 0, 0, // magic, version
  1, 4, 1, 0x60, 0, 0, 3, 2, 1, 0, // one function without parameters and results
  10, body.length + 7, 1, body.length + 5, 1, 1, 0x7b, ...body, 0x1a, 0x0b, // one local v128; body, drop, end
]);
const ADD = probe([0x20, 0, 0x20, 0, 0xfd, 0xe4, 0x01]); // f32x4.add
const RELAXED_MADD = probe([0x20, 0, 0x20, 0, 0x20, 0, 0xfd, 0x85, 0x02]); // f32x4.relaxed_madd

/** The best module that can run here, `"relaxed"` or `"simd128"`, or the one that is `wanted`. */
export function chooseModule(wanted) {
  if (wanted !== undefined && wanted !== "relaxed" && wanted !== "simd128") {
    throw new VisavisError("argument", `module ${named(wanted)}: "relaxed" or "simd128"`);
  }
  if (typeof WebAssembly !== "object" || !WebAssembly.validate(ADD)) {
    throw new VisavisError("unsupported", "This browser has no WebAssembly with SIMD: use a current Chrome, Edge, Firefox or Safari (16.4 or newer).");
  }
  const relaxed = WebAssembly.validate(RELAXED_MADD);
  if (wanted === "relaxed" && !relaxed) {
    throw new VisavisError("unsupported", "This engine has no relaxed SIMD: leave `module` out, or ask for \"simd128\".");
  }
  return wanted ?? (relaxed ? "relaxed" : "simd128");
}

/** Compiles a module from bytes, a compiled module, a URL or a `Response`. */
export async function compile(source) {
  const resolved = await source;
  if (resolved instanceof WebAssembly.Module) return resolved;
  if (resolved instanceof ArrayBuffer || ArrayBuffer.isView(resolved)) return WebAssembly.compile(resolved);
  const response = resolved instanceof Response ? resolved : await get(resolved);
  // Servers that do not know the type of .wasm are common: compile what came.
  return WebAssembly.compile(await response.arrayBuffer());
}

/** Fetches `url`, also from disk in Node. */
export async function get(url) {
  const absolute = new URL(url, globalThis.location?.href ?? import.meta.url);
  if (absolute.protocol === "file:" && globalThis.process?.versions?.node) {
    const files = "node:fs/promises"; // Out of bundlers' sight.
    try {
      return new Response(await (await import(files)).readFile(absolute));
    } catch (error) {
      throw new VisavisError("io", `cannot read ${absolute}: ${error.message}`, { cause: error });
    }
  }
  let response;
  try {
    response = await fetch(absolute);
  } catch (error) {
    throw new VisavisError("io", `cannot load ${absolute}: ${error.message}. A page from disk cannot fetch files: pass their bytes, or serve the folder.`, { cause: error });
  }
  if (!response.ok) throw new VisavisError("io", `cannot load ${absolute}: the server answers ${response.status} ${response.statusText}`.trim());
  return response;
}
