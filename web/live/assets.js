// What the page brings along: in the one file inside elements, else beside it, under the names in the element "files".
const text = (id) => document.getElementById(id)?.textContent;

async function inflated(stream) {
  if (typeof DecompressionStream === "undefined") throw new Error("The page cannot be unpacked: this browser is too old (no DecompressionStream). Versions since 2023 have it.");
  return new Response(stream.pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

// `keep`: it may be wanted again.
function stream(id, keep) {
  let raw;
  try { raw = atob(text(id)); } catch { throw new Error(`The page is damaged (${id}): it was not saved or copied whole. Get it again.`); }
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  if (!keep) document.getElementById(id).remove();
  return new Blob([bytes]).stream();
}

// A file beside the page, telling how far it is.
async function loaded(name, size, tell) {
  let answer;
  try { answer = await fetch(name); } catch { throw new Error(`${name} cannot be reached: there is no connection, and it was not loaded before.`); }
  if (!answer.ok) throw new Error(`${name} is missing beside the page (${answer.status}): copy the whole folder that web/build.sh makes.`);
  let got = 0;
  return answer.body.pipeThrough(new TransformStream({
    transform(chunk, out) { got += chunk.length; if (size) tell(Math.min(1, got / size), `Loading: ${(got / 1e6).toFixed(1)} of ${(size / 1e6).toFixed(1)} MB.`); out.enqueue(chunk); },
  }));
}

// `wanted`: name of the model to begin with, where there are several.
export async function readAssets(tell, wanted) {
  const files = text("files") ? JSON.parse(text("files")) : null;
  const { models, rate, names, lengths } = files?.contents ?? JSON.parse(text("contents"));
  const part = async (id, tell = () => {}, keep = false) => {
    const source = files ? await loaded(files[id], files.sizes[id], tell) : stream(id, keep);
    try {
      return await inflated(source);
    } catch (error) {
      if (!(error instanceof TypeError)) throw error;
      throw new Error(`The page is damaged (${id}): it was not saved or copied whole. Get it again.`);
    }
  };
  tell(0.02, "Unpacking the agent.");
  const model = (i, tell) => part(`model${i}`, tell, models.length > 1);
  const first = Math.max(0, models.findIndex(({ name }) => name === wanted));
  const [bundle, sound, relaxed, simd128, worker] = await Promise.all([model(first, tell), ...["sound", "relaxed", "simd128", "worker"].map((id) => part(id))]);
  const code = new TextDecoder().decode(worker);
  const pcm = new Int16Array(sound);
  let at = 0;
  const lines = names.map((name, i) => {
    const samples = Float32Array.from(pcm.subarray(at, at + lengths[i]), (x) => x / 32768);
    at += lengths[i];
    return { name, samples, rate };
  });
  let avatars = null;
  // The part that reads VRM files is a script of its own, run when first needed.
  const run = async () => {
    const script = document.createElement("script");
    if (files) {
      const done = new Promise((ok, no) => { script.onload = ok; script.onerror = () => no(new Error(`${files.avatars} is missing beside the page`)); });
      script.src = files.avatars;
      document.head.append(script);
      await done;
    } else {
      script.textContent = new TextDecoder().decode(await part("avatars"));
      document.head.append(script);
    }
    return window.visavisAvatars;
  };
  // From disk a worker's script cannot be a file.
  const startWorker = () => {
    const url = URL.createObjectURL(new Blob([code], { type: "text/javascript" }));
    try { return new Worker(url); } finally { URL.revokeObjectURL(url); }
  };
  return { bundle, models, first, model, wasm: { relaxed, simd128 }, worker: startWorker, lines, avatars: () => (avatars ??= run()) };
}
