/*
 * Visavis: full-body motion of a virtual agent from two voices, the user's head and sounds in the room. C interface.
 *
 * Use: load an engine from a bundle, make a session on it, push voices and head positions as they come, poll frames.
 * Units: metres, seconds, radians; right-handed, Y up. Times are session time: 0 when the session starts.
 *
 * OWNERSHIP
 *  - visavis_engine and visavis_session are opaque. Who makes one frees it, once, with visavis_engine_free or
 *    visavis_session_free; freeing NULL does nothing. A session keeps what it needs of its engine: the order of
 *    freeing is free. A pointer that was freed must not be used again.
 *  - Arrays that are passed in stay the caller's and are not kept: they may be changed or freed when the call has returned, not
 *    before. A file descriptor stays the caller's and may be closed when the call has returned.
 *  - Arrays and structs that are filled belong to the caller, who gives their size; nothing is written beyond it.
 *  - Strings that are returned belong to the library and must not be freed: names live as long as their engine,
 *    visavis_last_error's text until the next call of this library by the same thread, visavis_version's for ever.
 *
 * THREADS
 *  - An engine may be used by any number of threads at once, and so may the inputs and settings of a session: the functions push, finish,
 *    clear, end, set (but set_fallback) and report. They never wait for a block or for another thread, and never return VISAVIS_STATUS_BUSY, whatever the others
 *    do. A block goes by what came before its poll began: the same inputs give the same motion, whichever threads they come from. A
 *    voice is one stream: one thread pushes its sound, while commands may come from others. So is
 *    each sound source. After the first push of a voice, or of another rate, pushing does not allocate.
 *  - All other functions of a session, poll, reset, set_fallback and stats among them, are one thread's at a time, though not always the same one's: such
 *    a call while another one is under way returns VISAVIS_STATUS_BUSY and does nothing. Freeing is the last call of all.
 *
 * ERRORS
 *  - Functions that can fail return VISAVIS_STATUS_OK (0) or a reason; visavis_last_error then says what is wrong and
 *    what to do. Output arguments are written on success only, but pointers to new objects are set to NULL on failure.
 *  - No panic or exception leaves the library. VISAVIS_STATUS_PANIC is a fault of the library; a session that met one
 *    refuses all further calls but visavis_session_free.
 *
 * VERSIONS
 *  - Call visavis_check_abi(VISAVIS_ABI_VERSION) once. Same major number and a library at least as new as the
 *    header fit together. Structs grow at their end only; each says how large the caller believes it to be (struct_size, or an argument),
 *    so that an old program runs with a new library. visavis_joint and visavis_voice_stats never grow. A program that is newer than
 *    its library is refused with VISAVIS_STATUS_ABI, by visavis_check_abi and where it uses an option that the library does not know.
 */


#ifndef VISAVIS_H
#define VISAVIS_H

/* Generated from the Rust code: cargo run -p visavis-header */

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// Version of this interface, 1.3: major number in the upper 16 bits, minor in the lower.
#define VISAVIS_ABI_VERSION ((1 << 16) | 3)

// Frames that a poll gives when a block is due.
#define VISAVIS_BLOCK_FRAMES 4

// What became of a call.
enum visavis_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Done.
    VISAVIS_STATUS_OK = 0,
    // A null or misaligned pointer, a value out of range, an array too small.
    VISAVIS_STATUS_ARGUMENT = 1,
    // A file could not be read.
    VISAVIS_STATUS_IO = 2,
    // The bundle is damaged: truncated, not safetensors, weights that are not finite.
    VISAVIS_STATUS_BUNDLE_CORRUPT = 3,
    // The bundle is of a format that this library does not read.
    VISAVIS_STATUS_BUNDLE_VERSION = 4,
    // The bundle's config and tensors disagree.
    VISAVIS_STATUS_BUNDLE_INVALID = 5,
    // Audio of a bad rate, of which nothing was taken, or samples that are not finite, in whose
    // place there is silence.
    VISAVIS_STATUS_AUDIO = 6,
    // The call does not fit the session's state, for example time that runs backwards.
    VISAVIS_STATUS_STATE = 7,
    // VISAVIS_CPU asks for a level that this CPU does not have.
    VISAVIS_STATUS_CPU_LEVEL = 8,
    // Another thread is inside this session. Pushes and settings never meet this.
    VISAVIS_STATUS_BUSY = 9,
    // Program and library do not fit together.
    VISAVIS_STATUS_ABI = 10,
    // A fault of the library; please report the text.
    VISAVIS_STATUS_PANIC = 11,
    // Any other error.
    VISAVIS_STATUS_OTHER = 12,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum visavis_status visavis_status;
#else
typedef int32_t visavis_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How a block is made: evaluations of the network against quality.
enum visavis_sampler_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Midpoint rule with 1, 2 or 4 steps: two evaluations each. 4 is the reference.
    VISAVIS_SAMPLER_KIND_MIDPOINT = 0,
    // Euler's rule with 1 to 64 steps: one evaluation each.
    VISAVIS_SAMPLER_KIND_EULER = 1,
    // The distilled student: one evaluation, steps are ignored. Needs a bundle that has one.
    VISAVIS_SAMPLER_KIND_SINGLE = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum visavis_sampler_kind visavis_sampler_kind;
#else
typedef int32_t visavis_sampler_kind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// One of the two voices.
enum visavis_voice
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // The agent's own, usually known ahead.
    VISAVIS_VOICE_AGENT = 0,
    // The user's, as the microphone hears it.
    VISAVIS_VOICE_USER = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum visavis_voice visavis_voice;
#else
typedef int32_t visavis_voice;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// A set of OpenXR body joints.
enum visavis_body
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // XR_FB_body_tracking: 70 joints.
    VISAVIS_BODY_FB = 0,
    // XR_META_body_tracking_full_body: the same, and 14 of the legs.
    VISAVIS_BODY_META_FULL_BODY = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum visavis_body visavis_body;
#else
typedef int32_t visavis_body;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// A loaded bundle: immutable, shared by any number of sessions.
typedef struct visavis_engine visavis_engine;

// One conversation with one user.
typedef struct visavis_session visavis_session;

// Options of a session. Fill with visavis_session_options_init, then change what is needed.
typedef struct visavis_session_options {
    // sizeof(visavis_session_options).
    uint32_t struct_size;
    // Threads that compute a block, 1 (the caller of visavis_session_poll) or 2; the motion is the
    // same. Default 1.
    uint32_t threads;
    // Same seed and same inputs: same motion, bit for bit. Default 0.
    uint64_t seed;
    // Cores that the second thread may run on, bit i for core i; 0 (default): any. Linux and
    // Android.
    uint64_t core_mask;
    // A visavis_sampler_kind; default midpoint.
    int32_t sampler_kind;
    // Steps of the sampler; default 4.
    uint32_t sampler_steps;
    // Gaze target, -1 to 1 (0 is averted, 1 sustained eye contact); NaN (default): what comes
    // naturally.
    float gaze;
    // Guidance weight, 0 to 20; NaN (default): the bundle's.
    float guidance;
    // Weight of the gaze target, 0 to 20; NaN (default): the bundle's.
    float gaze_guidance;
    // Scale of the noise, 0 to 2; less is calmer. NaN (default): the bundle's.
    float temperature;
    // Where the agent stands at the start: x and z, metres; heading, radians (0 faces +Z, positive
    // turns towards +X).
    double start_x;
    // See start_x.
    double start_z;
    // See start_x.
    double start_yaw;
    // Whether planted feet are kept in place; 1 by default.
    uint32_t stance;
    // Whether frames that no body could show are replaced by a held pose; 1 by default.
    uint32_t guard;
    // Milliseconds that a block may take, 1 to 133.3: a governor then chooses the sampler of each
    // block, the session's sampler at best, so that none comes late. 0 (default): the session's
    // sampler, always.
    float budget_ms;
    // 0.
    uint32_t reserved;
    // Since interface 1.2. Seconds of sound that each voice may be ahead of the block that was
    // computed last, 0.5 to 60 (default); what is more is dropped and counted. A second takes 192
    // KB: a crowd that hears sound as it comes does with the least.
    double voice_ahead;
    // Since interface 1.3. How much the agent minds sounds in the room: -1 dull, 0 (default)
    // neutral, 1 sensitive, numbers between and up to 1.5 either way.
    float sensitivity;
    // 0.
    uint32_t reserved2;
} visavis_session_options;

// One frame of motion, without its joints. World coordinates: metres, right-handed, Y up.
typedef struct visavis_frame {
    // Number of the frame since the session started.
    uint64_t index;
    // Session time at which it is shown, seconds: index / 30.
    double time;
    // Where the agent stands: floor projection of the hips.
    double root_x;
    // See root_x.
    double root_z;
    // Heading, radians: the agent faces (sin yaw, 0, cos yaw).
    double root_yaw;
    // Position of the hips of the rig with fixed bone lengths.
    float hips[3];
    // Largest distance between a decoded joint and the rig's, metres.
    float fit_error;
    // Gaze score, -1 to 1; NaN while the user's position is not known.
    float gaze;
    // What made this frame: a visavis_sampler_kind; -1: something newer.
    int32_t sampler_kind;
    // Steps of that sampler.
    uint32_t sampler_steps;
    // How much of the frame is a held pose instead of the model's, 0 to 1.
    float held;
} visavis_frame;

// One joint of a frame. Quaternions are x, y, z, w.
typedef struct visavis_joint {
    // Rotation relative to the parent on the rig with fixed bone lengths (hips: relative to the
    // world): for humanoid rigs.
    float local[4];
    // Decoded position in the world.
    float position[3];
    // Decoded rotation in the world, from the T-pose.
    float rotation[4];
} visavis_joint;

// Counters of a voice, 24 kHz samples unless said otherwise.
typedef struct visavis_voice_stats {
    // Silence in place of sound that had not come, while the voice was present.
    uint64_t underrun_samples;
    // Dropped because so much sound was waiting already, a minute by default.
    uint64_t overflow_samples;
    // Clipped to 8 times full scale, input samples: a sign of integers pushed as floats.
    uint64_t clipped_samples;
} visavis_voice_stats;

// Statistics of a session since its start or reset. Set struct_size before the call.
typedef struct visavis_stats {
    // sizeof(visavis_stats).
    uint32_t struct_size;
    // 0.
    uint32_t reserved;
    // Blocks computed.
    uint64_t blocks;
    // Computation time of a block over the last 4096: median, milliseconds.
    double block_ms_p50;
    // 95th percentile.
    double block_ms_p95;
    // 99th percentile.
    double block_ms_p99;
    // Maximum.
    double block_ms_max;
    // From something that the user does to the start of the first block that can answer, at most,
    // milliseconds.
    double user_delay_ms;
    // The same for the agent's own voice; 0 when it is known ahead.
    double agent_delay_ms;
    // Times that recent motion was encoded anew.
    uint64_t anchorings;
    // Bytes of all key-value caches.
    uint64_t cache_bytes;
    // The agent's voice.
    struct visavis_voice_stats agent_voice;
    // The user's voice.
    struct visavis_voice_stats user_voice;
    // Head positions that were taken.
    uint64_t head_accepted;
    // Ignored: not finite.
    uint64_t head_non_finite;
    // Ignored: late (a block has used one of that time or later), or at the time of another.
    uint64_t head_out_of_order;
    // Ignored: more than 1 km from the origin, or a time of more than 10 million seconds.
    uint64_t head_absurd;
    // Taken, but too far from the one before to have walked there.
    uint64_t head_teleports;
    // Dropped to make room before they were asked for.
    uint64_t head_overwritten;
    // Blocks that took longer than the budget; this and the next four are 0 without a budget.
    uint64_t governor_missed;
    // Changes to a cheaper sampler.
    uint64_t governor_down;
    // Changes to a better sampler.
    uint64_t governor_up;
    // Blocks whose motion was held because even the cheapest sampler took too long.
    uint64_t governor_held_blocks;
    // Passes spent on bringing skipped flow times up to date.
    uint64_t governor_catch_up_passes;
    // Times that the plausibility guard took over.
    uint64_t guard_trips;
    // Frames that it held, or faded back.
    uint64_t guard_held_frames;
    // Since interface 1.1. The agent's voice, input samples: not finite, which silence replaced.
    uint64_t agent_non_finite_samples;
    // Pushed at a rate out of range and not taken.
    uint64_t agent_bad_rate_samples;
    // Dropped because another thread was inside this voice's input and lost its core there for
    // long; a command that was dropped counts as one.
    uint64_t agent_contended_samples;
    // The same for the user's voice.
    uint64_t user_non_finite_samples;
    // See agent_bad_rate_samples.
    uint64_t user_bad_rate_samples;
    // See agent_contended_samples.
    uint64_t user_contended_samples;
    // Since interface 1.2. Blocks that the fallback made instead of a pose being held
    // (visavis_session_set_fallback).
    uint64_t governor_fallback_blocks;
    // Since interface 1.3. Pushes of sounds in the room that were taken, whole or in part; this and
    // the next nine are 0 where the bundle has no hearing.
    uint64_t sound_pieces;
    // Sources that began to sound.
    uint64_t sound_started;
    // Dropped because a source was more than ten seconds ahead, 24 kHz samples.
    uint64_t sound_overflow_samples;
    // Clipped to 64 pascals, input samples: a sign of integers pushed as floats.
    uint64_t sound_clipped_samples;
    // Not finite, which silence replaced, input samples.
    uint64_t sound_non_finite_samples;
    // Pushed at a rate out of range and not taken, input samples.
    uint64_t sound_bad_rate_samples;
    // Pushes with a place that is no number or absurdly far.
    uint64_t sound_bad_places;
    // Dropped because another thread was inside the same source's input and lost its core there
    // for long, input samples.
    uint64_t sound_contended_samples;
    // Pushes and sources that were dropped because too many, or sixteen louder ones, sounded.
    uint64_t sound_refused;
    // Sources that gave way to a louder one.
    uint64_t sound_replaced;
} visavis_stats;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Version of the interface that the library has.
uint32_t visavis_abi_version(void);

// Whether a program compiled for `abi_version` (pass VISAVIS_ABI_VERSION) can use this library.
visavis_status visavis_check_abi(uint32_t abi_version);

// Version of the library, such as "0.1.0".
const char *visavis_version(void);

// Loads the bundle at `path` (UTF-8).
visavis_status visavis_engine_from_path(const char *path, struct visavis_engine **engine);

// Loads the bundle that lies in an open file, `length` bytes from `offset` on (`length` 0: up to
// the end), such as an asset stored uncompressed in an APK. The descriptor's read position is not
// used or moved. Not on Windows.
visavis_status visavis_engine_from_fd(int32_t fd, uint64_t offset, uint64_t length, struct visavis_engine **engine);

// Loads a bundle from `length` bytes of memory, which are not needed afterwards.
visavis_status visavis_engine_from_memory(const uint8_t *bytes, size_t length, struct visavis_engine **engine);

// Frees an engine; sessions made on it live on.
void visavis_engine_free(struct visavis_engine *engine);

// Name of the model; NULL for a NULL engine.
const char *visavis_engine_name(const struct visavis_engine *engine);

// Whether the bundle has hearing, so that visavis_session_push_sound is heard: 1 or 0; 0 for a NULL
// engine. Since interface 1.3.
int32_t visavis_engine_has_hearing(const struct visavis_engine *engine);

// Number of joints of a frame; 0 for a NULL engine.
uint32_t visavis_engine_joint_count(const struct visavis_engine *engine);

// Name of a joint (VRM humanoid); NULL for a joint that is not there.
const char *visavis_engine_joint_name(const struct visavis_engine *engine, uint32_t joint);

// Parent of a joint into `parent` (-1: none), and its rest offset from there into `offset[3]`,
// metres. Either may be NULL.
visavis_status visavis_engine_joint(const struct visavis_engine *engine,
                                    uint32_t joint,
                                    int32_t *parent,
                                    float *offset);

// Number in OpenXR's `body` (a visavis_body) of the joint that stands for a joint of this engine;
// -1 if it has none.
int32_t visavis_engine_openxr_joint(const struct visavis_engine *engine, uint32_t joint, int32_t body);

// Joint of this engine that OpenXR's body joint `openxr_joint` (below 84) follows: its own, or the
// nearest one towards the hips; -1 for the root, which is the agent's place on the floor, and for
// numbers out of range.
int32_t visavis_engine_joint_for_openxr(const struct visavis_engine *engine, uint32_t openxr_joint);

// Fills `options` with the defaults; `struct_size` is sizeof(visavis_session_options).
visavis_status visavis_session_options_init(struct visavis_session_options *options, size_t struct_size);

// Starts a session on `engine`; `options` may be NULL for the defaults. All its memory is taken
// here.
visavis_status visavis_session_new(const struct visavis_engine *engine,
                                   const struct visavis_session_options *options,
                                   struct visavis_session **session);

// Frees a session.
void visavis_session_free(struct visavis_session *session);

// Appends to the agent's own voice: `count` mono samples, full scale 1, of `rate` Hz (8000 to
// 192000), up to a minute ahead of time (voice_ahead of the options). More is dropped and counted. Sound that has not come when
// a block is computed is silence there, is counted, and is heard later. A voice that was never
// pushed is absent, which is not the same as silent. Samples that are not finite become silence,
// are counted, and make the status VISAVIS_STATUS_AUDIO; all others are taken. From any thread,
// see THREADS.
visavis_status visavis_session_push_agent_audio(struct visavis_session *session,
                                                const float *samples,
                                                size_t count,
                                                uint32_t rate);

// Appends to the user's voice, as visavis_session_push_agent_audio.
visavis_status visavis_session_push_user_audio(struct visavis_session *session,
                                               const float *samples,
                                               size_t count,
                                               uint32_t rate);

// Ends an utterance of a voice (a visavis_voice): the last milliseconds, which wait in the
// resampler, come out. Optional.
visavis_status visavis_session_finish_audio(struct visavis_session *session, int32_t which);

// Drops all sound of a voice (a visavis_voice) that has not been used, as when an utterance is
// broken off.
visavis_status visavis_session_clear_audio(struct visavis_session *session, int32_t which);

// Makes a voice (a visavis_voice) present, silent until something is pushed (`present` not 0), or
// absent until the next push (0).
visavis_status visavis_session_set_audio_present(struct visavis_session *session, int32_t which, int32_t present);

// Tells where the user's head is (midpoint of the eyes), world metres, at `time` seconds of
// session time. Any rate; positions are put in order by time. Those that are late, not finite or
// impossible are ignored and counted (visavis_stats). From any thread.
visavis_status visavis_session_push_user_head(struct visavis_session *session, float x, float y, float z, double time);

// As visavis_session_push_user_head, with the head's rotation: a quaternion of about unit length
// in the world, identity where the user faces +Z. Bundles of the kind `dram` see where the face
// points and how the head nods; the others make the same motion with and without.
visavis_status visavis_session_push_user_pose(struct visavis_session *session,
                                              float x,
                                              float y,
                                              float z,
                                              float qx,
                                              float qy,
                                              float qz,
                                              float qw,
                                              double time);

// Pushes a piece of what sound source `id` in the room gives off: `count` mono samples of `rate` Hz
// (8000 to 192000), pascals as they are 1 m from it (RMS 1 is 94 dB SPL); (x, y, z) is where it is
// from now on, world metres.
//
// The first piece of a source, and the first after it ran dry, sounds from the start of the next
// block on; further pieces follow it without a gap, up to ten seconds ahead. No samples move a
// source that sounds. Sixteen sources sound at once: one more takes the place of the quietest at
// the agent's head, if it is louder. What is dropped is counted (visavis_stats).
//
// VISAVIS_STATUS_ARGUMENT where the bundle has no hearing (visavis_engine_has_hearing), and for a
// place that is not finite or beyond 2000 km; the sound of a source that has a place is taken all
// the same. VISAVIS_STATUS_AUDIO for a rate out of range, of which nothing is taken, and for
// samples that are not finite, in whose place there is silence. From any thread, one at a time for
// a source. Since interface 1.3.
visavis_status visavis_session_push_sound(struct visavis_session *session,
                                          uint32_t id,
                                          const float *samples,
                                          size_t count,
                                          uint32_t rate,
                                          float x,
                                          float y,
                                          float z);

// Ends sound source `id` at once: what no block has heard of it is dropped. Without effect where
// it does not sound; VISAVIS_STATUS_ARGUMENT where the bundle has no hearing. From any thread.
// Since interface 1.3.
visavis_status visavis_session_end_sound(struct visavis_session *session, uint32_t id);

// Pushes a piece of what two microphones at the agent's ears hear, pascals: `count` samples of each,
// of `rate` Hz (8000 to 192000). For hosts that do not know where sounds are: the direction is
// estimated, as the agent's head turns; distance and height are not.
//
// The first piece, and the first after they ran dry, is heard from the start of the next block on;
// further pieces follow without a gap, up to ten seconds ahead (more is dropped and counted). No
// samples change nothing.
//
// VISAVIS_STATUS_ARGUMENT where the bundle has no hearing; VISAVIS_STATUS_AUDIO for a rate out of
// range, of which nothing is taken, and for samples that are not finite, in whose place there is
// silence. From any thread, one at a time: what comes from another meanwhile is dropped and
// counted. Since interface 1.3.
visavis_status visavis_session_push_ears(struct visavis_session *session,
                                         const float *left,
                                         const float *right,
                                         size_t count,
                                         uint32_t rate);

// Ends what visavis_session_push_ears brought at once: what no block has heard of it is dropped.
// VISAVIS_STATUS_ARGUMENT where the bundle has no hearing. From any thread. Since interface 1.3.
visavis_status visavis_session_end_ears(struct visavis_session *session);

// Sets how much the agent minds sounds in the room from the next block on: -1 dull, 0 neutral, 1
// sensitive, numbers between and up to 1.5 either way. Since interface 1.3.
visavis_status visavis_session_set_sensitivity(struct visavis_session *session, float sensitivity);

// Sets the gaze target from the next block on, -1 to 1: 0 is averted, 1 sustained eye
// contact.
visavis_status visavis_session_set_gaze(struct visavis_session *session, float target);

// Leaves the gaze to the model from the next block on.
visavis_status visavis_session_set_natural_gaze(struct visavis_session *session);

// Sets the guidance weights, 0 to 20: of the conditioning as a whole (1 is none), and of the gaze
// target.
visavis_status visavis_session_set_guidance(struct visavis_session *session, float weight, float gaze);

// Sets the sampler from the next block on; `kind` is a visavis_sampler_kind.
visavis_status visavis_session_set_sampler(struct visavis_session *session, int32_t kind, uint32_t steps);

// Sets the milliseconds that a block may take, 1 to 133.3, from the next block on: a governor then
// chooses the sampler of each block, the session's at best. 0 pins the session's sampler.
visavis_status visavis_session_set_budget(struct visavis_session *session, float milliseconds);

// Gives a session with a budget an engine of the kind `dram`, of the same rig and delays, to step
// down to: where blocks of even the cheapest sampler come late three times in a row, that engine
// makes the motion, instead of a pose being held, through a cross-fade both ways.
// visavis_session_dyadic tells of its frames, governor_fallback_blocks counts its blocks. Takes
// memory; a reset keeps it; the engine may be freed afterwards. One thread's at a time, as
// visavis_session_poll. Since interface 1.2.
visavis_status visavis_session_set_fallback(struct visavis_session *session, const struct visavis_engine *engine);

// Tells the governor how long the last block took by the caller's clock, in place of what the
// session measured: for callers whose deadline covers more than visavis_session_poll.
visavis_status visavis_session_report_block_time(struct visavis_session *session, double milliseconds);

// Computes the next block if it is due at `now` (session time, seconds, never running backwards).
// Call it until `*frame_count` is 0: a caller that comes late gets all blocks that it missed.
//
// When a block is due, `*frame_count` becomes 4, and `frames[0..4]` and `joints` are filled; the
// joints of frame `i` start at `joints[i * visavis_engine_joint_count]`. `frame_size` is
// sizeof(visavis_frame); `joint_capacity`, in joints, must be at least 4 times the joint count.
// `joints` may be NULL with capacity 0 if only the frames are wanted. Nothing is allocated.
visavis_status visavis_session_poll(struct visavis_session *session,
                                    double now,
                                    struct visavis_frame *frames,
                                    size_t frame_size,
                                    struct visavis_joint *joints,
                                    size_t joint_capacity,
                                    uint32_t *frame_count);

// How much each joint follows the user rather than the agent's own voice and habit in the last
// block's frames, 0 to 1: the read-out of bundles of the kind `dram`. `*count` becomes 4 times the
// joint count, the shares of frame `i` starting at `shares[i * visavis_engine_joint_count]`, or 0
// before the first block and where another bundle made the last one. `capacity` is the room in
// `shares`; too little is refused.
visavis_status visavis_session_dyadic(const struct visavis_session *session,
                                      float *shares,
                                      size_t capacity,
                                      size_t *count);

// Where the last block took what stands out among the sounds to be, into `position[3]`, world
// metres: the place of a source, or the direction that was estimated of what
// visavis_session_push_ears brought, 2 m away and 1.5 m over the floor. `*known` becomes 1, or 0
// and the position stays as it was, while nothing is known. Since interface 1.3.
visavis_status visavis_session_heard_place(const struct visavis_session *session, float *position, int32_t *known);

// Session time at which the next block is due, seconds, into `time`.
visavis_status visavis_session_next_due(const struct visavis_session *session, double *time);

// Starts anew with the options of now; session time is 0 again. Same inputs, same bits. What was
// pushed before is dropped.
visavis_status visavis_session_reset(struct visavis_session *session);

// Computes `blocks` blocks for nothing and starts anew, so that memory and CPU are warm when the
// first block is due.
visavis_status visavis_session_warm_up(struct visavis_session *session, uint32_t blocks);

// Kernel ids of the threads that the session owns and computes on, for performance hints: `*count`
// of them, the first `capacity` into `ids`. The thread that polls computes too
// (visavis_current_thread_id).
visavis_status visavis_session_worker_thread_ids(const struct visavis_session *session,
                                                 uint32_t *ids,
                                                 size_t capacity,
                                                 size_t *count);

// Fills `stats`.
visavis_status visavis_session_stats(const struct visavis_session *session, struct visavis_stats *stats);

// Text of the last error of the calling thread; empty after a call that succeeded. UTF-8, never
// NULL.
const char *visavis_last_error(void);

// The kernel's id of the calling thread (gettid), for performance hints; 0 where there is none.
uint32_t visavis_current_thread_id(void);

// Lets the calling thread run only on the cores of `mask` (bit i: core i). Linux and Android.
visavis_status visavis_pin_current_thread(uint64_t mask);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* VISAVIS_H */
