// A static server of the repository on localhost, and a headless Chromium on it.
import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { extname } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { root } from "./load.js";

const TYPES = { ".js": "text/javascript", ".mjs": "text/javascript", ".html": "text/html", ".wasm": "application/wasm" };

/** Serves the repository; `{ url, close }`. */
export async function serve() {
  const server = createServer(async (request, response) => {
    const { pathname } = new URL(request.url, "http://localhost");
    try {
      const body = pathname === "/" ? "<!doctype html><title>visavis</title>" : await readFile(fileURLToPath(new URL(`.${pathname}`, root)));
      response.writeHead(200, { "content-type": pathname === "/" ? TYPES[".html"] : (TYPES[extname(pathname)] ?? "application/octet-stream") });
      response.end(body);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return { url: `http://127.0.0.1:${server.address().port}/`, close: () => server.close() };
}

/** A browser. `VISAVIS_NODE_DIR` is where puppeteer-core is installed, `CHROMIUM` the browser (web/check.sh sets both). */
export async function chromium() {
  const require = createRequire(`${process.env.VISAVIS_NODE_DIR}/package.json`);
  const { default: puppeteer } = await import(pathToFileURL(require.resolve("puppeteer-core")));
  return puppeteer.launch({
    executablePath: process.env.CHROMIUM, headless: true, protocolTimeout: 1_200_000, timeout: 300_000,
    args: ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-dev-shm-usage"],
  });
}
