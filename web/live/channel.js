// What other programs may say to the agent: messages to the window, or on the BroadcastChannel "visavis" from other tabs of this address.
//
//   {visavis: "say", samples: Float32Array, rate: Hz}   appended to what the agent says, so that a TTS may send parts as they come
//   {visavis: "say", file: ArrayBuffer}                 a sound file (WAV, MP3, Ogg: what the browser decodes)
//   {visavis: "hear", samples, rate}                    appended to the user's voice
//   {visavis: "sound", name or samples (pascals at 1 m), rate, at: [x, y, z]}    {visavis: "sensitivity", value: -1 to 1}
//   {visavis: "interrupt"}    {visavis: "gaze", value: 0 to 1, or null: free}    {visavis: "state"}
// Each is answered to its sender by {visavis: "answer", to, ok, error?, state?}.
export function createChannel(acts) {
  async function take(message, answer) {
    if (message?.visavis === undefined || message.visavis === "answer") return;
    const act = Object.hasOwn(acts, message.visavis) ? acts[message.visavis] : null;
    try {
      if (!act) throw new Error(`there is no "${message.visavis}"; there are ${Object.keys(acts).join(", ")}`);
      answer({ visavis: "answer", to: message.visavis, ok: true, state: (await act(message)) ?? undefined });
    } catch (error) {
      answer({ visavis: "answer", to: message.visavis, ok: false, error: error.message });
    }
  }
  // From files every origin is "null", which postMessage takes as a target only as "*".
  window.addEventListener("message", ({ data, source }) => take(data, (text) => source?.postMessage(text, "*")));
  if (typeof BroadcastChannel === "undefined") return;
  const broadcast = new BroadcastChannel("visavis");
  broadcast.onmessage = ({ data }) => take(data, (text) => broadcast.postMessage(text));
}

// Samples of a message, or a typed refusal.
export function samplesOf({ samples, rate }) {
  if (!(samples instanceof Float32Array) || !(rate >= 8000 && rate <= 192000)) throw new Error("samples are a Float32Array of mono sound, rate is 8000 to 192000 Hz");
  return [samples, rate];
}
