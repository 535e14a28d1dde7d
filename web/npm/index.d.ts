/** What a failure is about; `message` says what to do. */
export type VisavisErrorKind =
  /** A value of the wrong type or out of range. */
  | "argument"
  /** Something could not be fetched or read. */
  | "io"
  /** The bundle is damaged. */
  | "bundle-corrupt"
  /** The bundle is of a format that this version does not read. */
  | "bundle-version"
  /** The bundle's parts disagree. */
  | "bundle-invalid"
  /** A rate out of range, or samples that are not finite, in whose place there is silence. */
  | "audio"
  /** The call does not fit the session's state. */
  | "state"
  | "cpu-level"
  /** No WebAssembly with SIMD here. */
  | "unsupported"
  /** The runtime stopped: load the engine again. */
  | "fault"
  /** The session or its engine was closed. */
  | "closed"
  | "other";

export class VisavisError extends Error {
  readonly kind: VisavisErrorKind;
}

/** Bytes, or where they are. */
export type Source = string | URL | ArrayBuffer | ArrayBufferView | Blob | Response;

export interface LoadOptions {
  /** The bundle (.safetensors). */
  bundle: Source;
  /** While the bundle comes over the network: bytes so far, and all of them where the server tells. */
  onProgress?: (progress: { loaded: number; total: number | null }) => void;
  /** Where the modules are, when they do not lie beside this file. */
  wasm?: { simd128?: WasmSource; relaxed?: WasmSource };
  /** A module by name, instead of the fastest that runs here. The motion is the same, bit for bit. */
  module?: "simd128" | "relaxed";
  /** The worker's script, when it does not lie beside this file, or what makes the worker. */
  worker?: string | URL | (() => Worker);
  /** Compute in this thread: for tests, and where there are no workers (Node). */
  inline?: boolean;
}
export type WasmSource = string | URL | ArrayBuffer | ArrayBufferView | WebAssembly.Module | Response | Promise<Response>;

export const Visavis: {
  /** Loads a bundle into a worker of its own. Rejects with a {@link VisavisError}. */
  load(options: LoadOptions): Promise<Engine>;
};

/** A loaded model. */
export interface Engine {
  readonly facts: EngineFacts;
  /** Starts a session; it is usable at once, `ready` tells when it runs. */
  session(options?: SessionOptions): Session;
  /**
   * Loads a bundle of the kind `dram`, of the same rig, into the same worker, for sessions to step down to ({@link Session.setFallback});
   * resolves to its facts.
   */
  loadFallback(bundle: Source): Promise<Omit<EngineFacts, "module">>;
  /** Ends all sessions and the worker. */
  close(): void;
}

export interface EngineFacts {
  version: string;
  /** What the bundle is for: the conversation model, or the featherweight tier, which is deterministic and has no samplers. */
  kind: "sarah" | "dram";
  /** Name and licence of the bundle, with the acknowledgements that its data asks for. */
  name: string;
  licence: string;
  /** The module that runs, and the kernels in it. */
  module: "simd128" | "relaxed";
  level: string;
  weightBytes: number;
  fps: 30;
  blockFrames: 4;
  /** Whether the sampler `single` can be used. */
  hasStudent: boolean;
  /** Whether sounds in the room are heard: {@link Session.pushSound}. */
  hasHearing: boolean;
  /** VRM humanoid names; the parent's index (null: none); offset from the parent in the T-pose that faces +Z, metres. */
  joints: { name: string; parent: number | null; offset: [number, number, number] }[];
  /** Midpoint of the eyes, and a point behind it, in the head's frame, metres. */
  eyes: [number, number, number];
  headBack: [number, number, number];
}

export type Sampler = "midpoint4" | "midpoint2" | "midpoint1" | "single" | `euler:${number}`;

export interface SessionOptions {
  /** Default `midpoint4`, the reference; `single` takes a fifth of the time. */
  sampler?: Sampler;
  /** Same seed and same inputs: same motion. A whole number from 0; default 0. */
  seed?: number;
  /** Gaze target: 0 (averted) to 1 (sustained eye contact), negative to -1; null (default): what comes naturally. */
  gaze?: number | null;
  /** Guidance weights, 0 to 20, and scale of the noise, 0 to 2; null (default): the bundle's. */
  guidance?: number | null;
  gazeGuidance?: number | null;
  temperature?: number | null;
  /** Milliseconds that a block may take, 1 to 133.3: cheaper samplers are used when it would take longer. 0 (default): never. */
  budget?: number;
  /** Where the agent stands: x and z in metres, heading in radians (0 faces +Z, positive turns towards +X). */
  start?: [number, number, number];
  /** Whether planted feet are kept in place, and frames that no body could show are replaced; true by default. */
  stance?: boolean;
  guard?: boolean;
  /**
   * Seconds of sound that each voice may be ahead of the block that was computed last, 0.5 to 60 (default); what is more is dropped and
   * counted. A second takes 192 KB: a crowd that hears sound as it comes does with the least.
   */
  voiceAhead?: number;
  /** How much the agent minds sounds in the room: -1 dull, 0 (default) neutral, 1 sensitive, up to 1.5 either way. */
  sensitivity?: number;
  /** `real` (default): blocks are computed as time goes by. `manual`: by {@link Session.advance}. */
  clock?: "real" | "manual";
}

/**
 * One conversation. Time is seconds since it started; a block is four frames, 133 ms. Pushes never wait and are never refused:
 * what is late or too much is dropped and counted ({@link Session.stats}). Wrong types and ranges throw a {@link VisavisError}.
 */
export interface Session {
  /** Resolves when the session runs; rejects when its options are wrong. */
  readonly ready: Promise<Session>;
  /** Session time now, seconds. */
  readonly time: number;
  /** What {@link Session.shown} is behind, seconds: a block. */
  delay: number;
  /** Receives the four frames of each block. */
  onFrames: ((frames: Frame[]) => void) | null;
  /** Receives what went wrong later; after kind `fault` the session has ended. */
  onError: ((error: VisavisError) => void) | null;

  /**
   * Where the midpoint of the user's eyes is, world metres, Y up, at session time `time` (default: now). Any rate. `rotation`: the
   * head's in the world, a quaternion x, y, z, w of about unit length, identity where the user faces +Z; bundles of the kind `dram` use it.
   */
  pushUserHead(x: number, y: number, z: number, time?: number, rotation?: ArrayLike<number> | null): void;
  /** Sound of the user: mono, full scale 1, `rate` 8000 to 192000 Hz. Pushed as it is heard. */
  pushUserVoice(samples: Float32Array, rate: number): void;
  /**
   * Sound that the agent says, up to a minute ahead ({@link SessionOptions.voiceAhead}). Resolves to the session time at which its first sample is heard;
   * play it at that time plus {@link Session.delay}, and lips and hands fit.
   */
  pushAgentVoice(samples: Float32Array, rate: number): Promise<number>;
  /** Ends an utterance: its last milliseconds come out of the resampler. Optional. */
  finishVoice(who: "agent" | "user"): void;
  /** Drops what has not been heard. */
  clearVoice(who: "agent" | "user"): void;
  /** Breaks off what the agent says. */
  interrupt(): void;
  /** Makes a voice present (silent until something is pushed) or absent. */
  setVoicePresent(who: "agent" | "user", present: boolean): void;
  /**
   * A piece of what sound source `id` in the room gives off: mono, pascals as they are 1 m from it (RMS 1 is 94 dB SPL), `rate` 8000 to
   * 192000 Hz; `position` is where it is from now on, world metres. The first piece of a source sounds from the next block on, further ones
   * follow it, up to ten seconds ahead; none at all moves a source that sounds. Sixteen sound at once, the loudest ones. Throws where the
   * bundle has no hearing; a place or samples that are not finite are told by {@link Session.onError} and counted.
   */
  pushSound(id: number, samples: Float32Array, rate: number, position: ArrayLike<number>): void;
  /** Ends a source at once. */
  endSound(id: number): void;
  /**
   * A piece of what two microphones at the agent's ears hear, pascals, as many samples of each, `rate` 8000 to 192000 Hz: for pages that do not
   * know where sounds are. The direction is estimated as the agent's head turns. Throws where the bundle has no hearing.
   */
  pushEars(left: Float32Array, right: Float32Array, rate: number): void;
  /** Ends what the ears brought at once. */
  endEars(): void;
  /**
   * Where the last block took what stands out among the sounds to be, x, y, z in world metres: the place of a source, or, of what
   * {@link Session.pushEars} brought, the direction that was estimated, 2 m away and 1.5 m over the floor. Null before any sound, two seconds
   * after it has faded, and where the bundle has no hearing.
   */
  heardPlace(): Promise<[number, number, number] | null>;
  /** How much the agent minds sounds in the room: -1 dull, 0 neutral, 1 sensitive, up to 1.5 either way. */
  setSensitivity(sensitivity: number): void;
  setGaze(target: number | null): void;
  setSampler(sampler: Sampler): Promise<void>;
  setBudget(milliseconds: number): Promise<void>;
  /**
   * With a budget: where blocks of even the cheapest sampler come late, the bundle of {@link Engine.loadFallback} makes the motion,
   * instead of a pose being held. Its frames have {@link Frame.dyadic}; `stats().governor.fallbackBlocks` counts its blocks.
   */
  setFallback(): Promise<void>;
  /** Tells how long the last block took by the page's own measure, milliseconds, in place of what was measured: the budget goes by it. */
  reportBlockTime(milliseconds: number): Promise<void>;

  /** What to show at session time `time` (default: now), {@link Session.delay} behind; null before the first frame. */
  shown(time?: number): { frame: Frame; next: Frame; /** From `frame` to `next`, 0 to 1. */ fraction: number } | null;
  stats(): Promise<SessionStats>;
  /** Stops and goes on with time; for pages that are not seen. */
  pause(): void;
  resume(): Promise<void>;
  /** With `clock: "manual"`: computes as many seconds as fast as it goes. */
  advance(seconds: number): Promise<void>;
  /** Starts anew, as if just made. */
  reset(): Promise<void>;
  close(): void;
}

/** World coordinates: metres, right-handed, Y up. Quaternions are x, y, z, w. */
export interface Frame {
  index: number;
  /** Session time, seconds: index / 30. */
  time: number;
  /** Floor projection of the hips, and heading: the agent faces (sin yaw, 0, cos yaw). */
  root: { x: number; z: number; yaw: number };
  /** Position of the hips of the rig with fixed bone lengths. */
  hips: [number, number, number];
  /** Largest distance between a decoded joint and the rig's, metres. */
  fitError: number;
  /** Gaze score, -1 to 1; null while the user's position is not known. */
  gaze: number | null;
  sampler: Sampler;
  /** How much of the frame is a held pose instead of the model's, 0 to 1. */
  held: number;
  /**
   * Eleven numbers per joint, in the order of {@link EngineFacts.joints}: rotation relative to the parent on the rig with fixed
   * bone lengths (hips: to the world), for humanoid rigs; then the decoded position and rotation (from the T-pose) in the world.
   */
  joints: Float32Array;
  /**
   * How much each joint follows the user rather than the agent's own voice and habit, 0 to 1, in the order of the joints: the
   * read-out of bundles of the kind `dram`; null where another one made the frame.
   */
  dyadic: Float32Array | null;
}

export interface SessionStats {
  blocks: number;
  /** Computation times of the last 4096 blocks, milliseconds. */
  blockMs: { p50: number; p95: number; p99: number; max: number };
  userDelayMs: number;
  agentDelayMs: number;
  anchorings: number;
  cacheBytes: number;
  memoryBytes: number;
  agentVoice: VoiceStats;
  userVoice: VoiceStats;
  head: { accepted: number; nonFinite: number; outOfOrder: number; absurd: number; teleports: number; overwritten: number };
  /** Of all sources in the room together; zeros where the bundle has no hearing. `refused`: too many sounded, `replaced`: by louder ones. */
  sounds: {
    pieces: number; started: number; overflowSamples: number; clippedSamples: number; nonFiniteSamples: number; badRateSamples: number;
    badPlaces: number; refused: number; replaced: number;
  };
  governor: { missed: number; down: number; up: number; heldBlocks: number; fallbackBlocks: number; catchUpPasses: number };
  guardTrips: number;
  guardHeldFrames: number;
}
export interface VoiceStats {
  underrunSamples: number;
  overflowSamples: number;
  clippedSamples: number;
  nonFiniteSamples: number;
  badRateSamples: number;
}
