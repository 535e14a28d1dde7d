// Both voices through Web Audio, in step with the picture. While sound plays, its clock is the clock.

function createAudio(d) {
  const voices = [["agent", d.agentVoice, -0.25], ["user", d.userVoice, 0.25], ["heard", d.heard, 0]].filter(([, samples]) => samples && samples.length);
  const audio = { available: voices.length > 0, muted: false };
  let context = null, gain = null, buffers = [], sources = [], started = null;

  function open() {
    const Context = window.AudioContext || window.webkitAudioContext;
    if (context || !Context) return;
    context = new Context();
    gain = context.createGain();
    gain.gain.value = audio.muted ? 0 : 1;
    gain.connect(context.destination);
    buffers = voices.map(([, samples, side]) => {
      const buffer = context.createBuffer(1, samples.length, d.audioRate);
      buffer.getChannelData(0).set(Float32Array.from(samples, (s) => s / 32768));
      return { buffer, side };
    });
  }

  audio.stop = () => {
    for (const source of sources) source.stop();
    sources = [];
    started = null;
  };

  // Plays from `time` on. Browsers allow sound only after a gesture of the user; without, the picture plays silently.
  audio.play = (time, speed) => {
    audio.stop();
    if (!audio.available) return;
    open();
    if (!context) return;
    context.resume().catch(() => {});
    const begin = context.currentTime + 0.02;
    for (const { buffer, side } of buffers) {
      if (time >= buffer.duration) continue;
      const source = context.createBufferSource();
      source.buffer = buffer;
      source.playbackRate.value = speed;
      const pan = context.createStereoPanner?.();
      if (pan) pan.pan.value = side;
      (pan ? source.connect(pan) : source).connect(gain);
      source.start(begin, time);
      sources.push(source);
    }
    started = { begin, time, speed };
  };

  // Position of the sound in seconds, or null while none is heard.
  audio.time = () => {
    if (!started || !sources.length || context.state !== "running") return null;
    const delay = context.outputLatency || 0;
    return started.time + Math.max(0, context.currentTime - delay - started.begin) * started.speed;
  };

  audio.mute = (muted) => {
    audio.muted = muted;
    if (gain) gain.gain.value = muted ? 0 : 1;
  };
  return audio;
}
