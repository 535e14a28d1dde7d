// The package as built (out/web/npm), on files of the repository.
import { readFileSync } from "node:fs";

export const root = new URL("../../", import.meta.url);
export const built = new URL("out/web/npm/", root);
export const { Visavis, VisavisError } = await import(new URL("index.js", built));

/** Loads a bundle of the repository by its path; `bundle` may also be bytes. */
export function load({ bundle = "tests/goldens/tiny.safetensors", ...options } = {}) {
  const bytes = typeof bundle === "string" ? readFileSync(new URL(bundle, root)) : bundle;
  return Visavis.load({ bundle: bytes, ...options });
}
