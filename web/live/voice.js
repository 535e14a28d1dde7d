// The agent's voice: what is said goes to the session a little ahead of time, and to the ear when the frames made for it are shown.
//
// The session's line of the agent's voice is kept fed, with silence between utterances, so that a sample's number is its session time.
import { BLOCK, DELAY } from "./agent.js";

const RATE = 24000;
const AHEAD = 2 * BLOCK;

export function createVoice(agent, openContext) {
  const utterances = [];
  let fed = 0, gain = null;
  const voice = { volume: 1 };

  const endOf = (u) => u.start + u.samples.length / RATE;

  // Feeds what the coming blocks need. Called each block and each frame.
  voice.feed = () => {
    // What the session has computed already it has heard as silence.
    fed = Math.max(fed, Math.round(agent.computed() * RATE));
    const until = Math.round((Math.max(agent.now(), agent.computed()) + AHEAD) * RATE);
    if (until <= fed) return;
    const chunk = new Float32Array(until - fed);
    for (const u of utterances) {
      const from = fed - Math.round(u.start * RATE);
      for (let i = Math.max(0, -from); i < chunk.length && from + i < u.samples.length; i++) chunk[i] += u.samples[from + i];
    }
    agent.session.pushAgentVoice(chunk, RATE);
    fed = until;
    while (utterances.length && endOf(utterances[0]) < agent.shown() - 0.5) utterances.shift();
  };

  // Says samples of any rate after what is being said; resolves when they are scheduled.
  voice.say = async (samples, rate, name = "a voice") => {
    const context = openContext();
    const mono = rate === RATE ? samples : await resampled(samples, rate);
    const start = Math.max(fed / RATE, ...utterances.map(endOf));
    const u = { start, samples: mono, name, source: null };
    utterances.push(u);
    if (context) {
      await context.resume().catch(() => {});
      gain ??= Object.assign(context.createGain());
      gain.connect(context.destination);
      gain.gain.value = voice.volume;
      if (utterances.includes(u)) play(u, context);
    }
    return u;
  };

  // By the clock of the sound: the frames for session time t are seen at t + DELAY.
  function play(u, context) {
    const buffer = context.createBuffer(1, Math.max(1, u.samples.length), RATE);
    buffer.getChannelData(0).set(u.samples);
    u.source = context.createBufferSource();
    u.source.buffer = buffer;
    u.source.connect(gain);
    const wait = u.start + DELAY - agent.now() - (context.outputLatency || context.baseLatency || 0);
    u.at = context.currentTime + Math.max(0, wait);
    u.source.start(u.at, Math.max(0, -wait));
  }

  // Stops at once what is heard; the body hears silence from the next samples on that are fed.
  voice.interrupt = () => {
    const speaking = voice.speaking();
    for (const u of utterances) u.source?.stop();
    const kept = fed / RATE;
    for (const u of utterances) u.samples = u.samples.subarray(0, Math.max(0, Math.round((kept - u.start) * RATE)));
    utterances.forEach((u) => { u.silenced = true; });
    return speaking;
  };

  const heard = () => utterances.filter((u) => !u.silenced && agent.shown() >= u.start && agent.shown() < endOf(u));
  voice.speaking = () => utterances.some((u) => !u.silenced && agent.shown() < endOf(u));
  voice.saying = () => heard()[0]?.name ?? null;

  // Loudness now, 0 to 1 of speech's usual loud parts: mean square of 40 ms.
  voice.level = () => {
    let sum = 0;
    for (const u of heard()) {
      const i = Math.round((agent.shown() - u.start) * RATE);
      for (let k = Math.max(0, i - 480); k < Math.min(u.samples.length, i + 480); k++) sum += u.samples[k] * u.samples[k];
    }
    return Math.min(1, Math.sqrt(sum / 960) / 0.16);
  };
  return voice;
}

async function resampled(samples, rate) {
  const length = Math.max(1, Math.round((samples.length * RATE) / rate));
  const offline = new OfflineAudioContext(1, length, RATE);
  const buffer = offline.createBuffer(1, samples.length, rate);
  buffer.getChannelData(0).set(samples);
  const source = offline.createBufferSource();
  source.buffer = buffer;
  source.connect(offline.destination);
  source.start();
  return (await offline.startRendering()).getChannelData(0);
}

// A sound file's samples, its channels' mean.
export async function decoded(bytes) {
  const offline = new OfflineAudioContext(1, 1, RATE);
  const buffer = await offline.decodeAudioData(bytes);
  const out = new Float32Array(buffer.length);
  for (let c = 0; c < buffer.numberOfChannels; c++) buffer.getChannelData(c).forEach((x, i) => { out[i] += x / buffer.numberOfChannels; });
  return { samples: out, rate: buffer.sampleRate };
}
