// Block times against the deadline, real-time factor, frame times; and the report of a measurement.
import { BLOCK } from "./agent.js";

const middle = (list, share) => (list.length ? [...list].sort((a, b) => a - b)[Math.min(list.length - 1, Math.floor(share * list.length))] : NaN);
const ms = (x) => (Number.isFinite(x) ? `${x.toFixed(1)} ms` : "–");

export function createFigures({ agent, renderer, settings, state }) {
  let spans = [], late = 0;
  const figures = {
    frame(seconds, behind) {
      spans.push(1000 * seconds);
      if (spans.length > 600) spans.shift();
      if (behind > 0.05) late++;
    },
    restart() { spans = []; late = 0; },
  };

  async function rows() {
    const s = await agent.session.stats(), { p50, p95, p99, max } = s.blockMs, { calls, triangles } = renderer.counts();
    const frame = middle(spans, 0.5);
    return [
      ["Model", `${agent.facts.name}${agent.facts.kind === "dram" ? "" : `, sampler ${settings.sampler}`}, gaze ${settings.gaze ?? "free"}`],
      ...(state().dyadic ? [["Follows you", `${(100 * state().dyadic).toFixed(0)} %, mean of the joints`]] : []),
      ["Module", `${agent.facts.module} (${agent.facts.level}), visavis ${agent.facts.version}, ${(s.memoryBytes / 1e6).toFixed(0)} MB`],
      ["Block", `median ${ms(p50)}, 95 % ${ms(p95)}, 99 % ${ms(p99)}, worst ${ms(max)} of ${ms(1000 * BLOCK)}`],
      ["Speed", `${((1000 * BLOCK) / p50).toFixed(1)} times real time`],
      ["Blocks", `${s.blocks}, ${s.governor?.missed ?? 0} late`],
      ["Picture", `median ${ms(frame)} (${(1000 / frame).toFixed(0)} a second), 99 % ${ms(middle(spans, 0.99))}, ${late} late`],
      ["Drawing", `${calls} calls, ${Math.round(triangles / 1000)} thousand triangles, ${renderer.gl.drawingBufferWidth} x ${renderer.gl.drawingBufferHeight} pixels`],
    ];
  }

  figures.show = async () => {
    const list = document.getElementById("figures");
    const texts = (await rows()).flatMap(([name, value]) => [["dt", name], ["dd", value]]);
    list.replaceChildren(...texts.map(([tag, textContent]) => Object.assign(document.createElement(tag), { textContent })));
  };

  // Ten seconds of what runs, as text.
  figures.report = async (seconds = 10) => {
    figures.restart();
    await new Promise((done) => setTimeout(done, 1000 * seconds));
    const debug = renderer.gl.getExtension("WEBGL_debug_renderer_info");
    const about = [
      ["Browser", navigator.userAgent],
      ["Graphics", debug ? renderer.gl.getParameter(debug.UNMASKED_RENDERER_WEBGL) : "?"],
      ["Processors", `${navigator.hardwareConcurrency ?? "?"} logical, ${navigator.deviceMemory ?? "?"} GB`],
      ["Shown", state().mode],
    ];
    return ["Visavis live: report", ...[...about, ...(await rows())].map(([name, value]) => `${name}: ${value}`)].join("\n");
  };
  setInterval(() => document.getElementById("more").open && figures.show(), 1000);
  return figures;
}
