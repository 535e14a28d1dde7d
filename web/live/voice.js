// The agent's voice: the session hears it as soon as it is there; the ear hears it when the frames made for it are shown.
//
// A push tells the session time of its first sample. The sound of that moment is due `delay` later, by the clock of the AudioContext.
const RATE = 24000;

export function createVoice(agent, openContext) {
  let utterances = [], gain = null, turn = 0;
  const voice = {};
  const endOf = (u) => u.start + u.samples.length / u.rate;

  // Says mono samples of any rate (8 to 192 kHz) after what is being said already.
  voice.say = async (samples, rate, name = "a voice") => {
    const mine = turn, context = openContext();
    const starts = agent.session.pushAgentVoice(samples, rate);
    await context?.resume().catch(() => {});
    const u = { samples, rate, name, start: await starts, source: null };
    if (mine !== turn) return u;
    utterances = utterances.filter((old) => endOf(old) > agent.shown());
    utterances.push(u);
    if (context) play(u, context);
    return u;
  };

  function play(u, context) {
    if (!gain) {
      gain = context.createGain();
      gain.connect(context.destination);
    }
    const buffer = context.createBuffer(1, u.samples.length, u.rate);
    buffer.getChannelData(0).set(u.samples);
    u.source = context.createBufferSource();
    u.source.buffer = buffer;
    u.source.connect(gain);
    const wait = u.start - agent.shown() - (context.outputLatency || context.baseLatency || 0);
    u.at = context.currentTime + wait;
    // What should have been heard already is left out, so that the rest is in step.
    u.source.start(Math.max(context.currentTime, u.at), Math.max(0, -wait));
  }

  // Stops at once what is heard, and what the session has not used of it. Whether there was anything.
  voice.interrupt = () => {
    const speaking = voice.speaking();
    turn++;
    agent.session.interrupt();
    for (const u of utterances) u.source?.stop();
    utterances = [];
    return speaking;
  };

  const heard = () => utterances.find((u) => agent.shown() >= u.start && agent.shown() < endOf(u));
  voice.speaking = () => utterances.some((u) => agent.shown() < endOf(u));
  voice.saying = () => heard()?.name ?? null;
  // Seconds by which the sound is behind the picture; for tests and reports.
  voice.behind = (context) => {
    const u = heard();
    return u?.source ? agent.shown() - u.start - (context.currentTime - u.at) + (context.outputLatency || context.baseLatency || 0) : null;
  };

  // Where sound and picture came apart (a device that slept, a clock that jumped) the rest is played anew, in step.
  voice.keep = (context) => {
    const off = context?.state === "running" ? voice.behind(context) : null;
    if (off === null || Math.abs(off) < 0.08) return;
    const u = heard();
    u.source.stop();
    play(u, context);
  };

  // Loudness now, 0 to 1 of speech's usual loud parts: mean square of 40 ms.
  voice.level = () => {
    const u = heard();
    if (!u) return 0;
    const i = Math.round((agent.shown() - u.start) * u.rate), reach = Math.round(0.02 * u.rate);
    let sum = 0;
    for (let k = Math.max(0, i - reach); k < Math.min(u.samples.length, i + reach); k++) sum += u.samples[k] * u.samples[k];
    return Math.min(1, Math.sqrt(sum / (2 * reach)) / 0.16);
  };
  return voice;
}

// A sound file's samples, its channels' mean.
export async function decoded(bytes) {
  const offline = new OfflineAudioContext(1, 1, RATE);
  const buffer = await offline.decodeAudioData(bytes);
  const out = new Float32Array(buffer.length);
  for (let c = 0; c < buffer.numberOfChannels; c++) buffer.getChannelData(c).forEach((x, i) => { out[i] += x / buffer.numberOfChannels; });
  return { samples: out, rate: buffer.sampleRate };
}
