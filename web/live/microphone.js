// The microphone as the user's voice. The worklet comes as a data: URL, which works from file:// too; blobs do not.
const WORKLET = `registerProcessor("tap", class extends AudioWorkletProcessor {
  constructor() { super(); this.full = new Float32Array(1024); this.n = 0; }
  process([input]) {
    const x = input[0];
    if (!x) return true;
    for (let i = 0; i < x.length; i++) {
      this.full[this.n++] = x[i];
      if (this.n === 1024) { this.port.postMessage(this.full); this.n = 0; }
    }
    return true;
  }
});`;

const REASONS = {
  NotAllowedError: "the browser or you did not allow it; allow the microphone for this page and press again",
  NotFoundError: "this device has none",
  NotReadableError: "another program holds it",
};

export function createMicrophone(openContext, onSamples) {
  let stream = null, node = null;
  const microphone = { on: false, level: 0, peak: 0 };

  microphone.start = async () => {
    if (microphone.on) return;
    if (!navigator.mediaDevices?.getUserMedia) throw new Error("No microphone: this browser gives one only to pages from https or localhost. `visavis live` serves this page so.");
    const context = openContext();
    if (!context?.audioWorklet) throw new Error("No microphone: this browser has no AudioWorklet.");
    try {
      stream = await navigator.mediaDevices.getUserMedia({ audio: { echoCancellation: true, noiseSuppression: true, autoGainControl: true } });
    } catch (error) {
      throw new Error(`No microphone: ${REASONS[error.name] ?? error.message}.`);
    }
    await context.resume();
    await context.audioWorklet.addModule(`data:text/javascript,${encodeURIComponent(WORKLET)}`);
    node = new AudioWorkletNode(context, "tap", { numberOfOutputs: 0 });
    node.port.onmessage = ({ data }) => {
      let sum = 0;
      for (const x of data) sum += x * x;
      microphone.level = Math.sqrt(sum / data.length);
      onSamples(data, context.sampleRate, microphone.level);
    };
    context.createMediaStreamSource(stream).connect(node);
    microphone.on = true;
  };

  microphone.stop = () => {
    stream?.getTracks().forEach((track) => track.stop());
    node?.disconnect();
    Object.assign(microphone, { on: false, level: 0 });
    stream = node = null;
  };
  return microphone;
}
