/* Every function of visavis.h, used as a program would and as it should not. Arguments: the bundle, beside which
 * dram-tcn.safetensors and hearing.safetensors lie. Exit code 0 when all is well. */
#include "check.h"
#include <fcntl.h>
#include <inttypes.h>
#include <math.h>
#include <pthread.h>
#include <string.h>
#include <unistd.h>

/* Linux and Android number threads for performance hints and let them be pinned. */
#ifdef __linux__
#define HAS_THREAD_IDS 1
#else
#define HAS_THREAD_IDS 0
#endif

static char *read_all(const char *path, size_t *length) {
    FILE *file = fopen(path, "rb");
    CHECK(file && fseek(file, 0, SEEK_END) == 0);
    *length = (size_t)ftell(file);
    rewind(file);
    char *bytes = malloc(*length);
    CHECK(bytes && fread(bytes, 1, *length, file) == *length);
    fclose(file);
    return bytes;
}

static void loading(const char *path) {
    visavis_engine *engine = NULL;
    size_t length;
    char *bytes = read_all(path, &length);
    OK(visavis_engine_from_memory((const uint8_t *)bytes, length, &engine));
    visavis_engine_free(engine);
    /* Exact-sized copies: what reads beyond the end is caught by the sanitizer. */
    for (size_t cut = 0; cut < length; cut += length / 7) {
        uint8_t *part = malloc(cut ? cut : 1);
        memcpy(part, bytes, cut);
        REFUSED(BUNDLE_CORRUPT, visavis_engine_from_memory(part, cut, &engine));
        CHECK(engine == NULL);
        free(part);
    }
    memset(bytes + length - 4, 0xff, 4);
    REFUSED(BUNDLE_CORRUPT, visavis_engine_from_memory((const uint8_t *)bytes, length, &engine));
    free(bytes);

#ifdef _WIN32
    REFUSED(ARGUMENT, visavis_engine_from_fd(0, 0, 0, &engine));
#else
    char apk[] = "/tmp/visavis-XXXXXX";
    int out = mkstemp(apk), in;
    bytes = read_all(path, &length);
    CHECK(out >= 0 && write(out, "PK..3", 5) == 5 && write(out, bytes, length) == (ssize_t)length && write(out, "..", 2) == 2);
    close(out);
    free(bytes);
    CHECK((in = open(apk, O_RDONLY)) >= 0);
    OK(visavis_engine_from_fd(in, 5, length, &engine));
    visavis_engine_free(engine);
    REFUSED(BUNDLE_CORRUPT, visavis_engine_from_fd(in, 4, length, &engine));
    REFUSED(ARGUMENT, visavis_engine_from_fd(in, 5, length + 3, &engine));
    close(in);
    REFUSED(IO, visavis_engine_from_fd(in, 5, length, &engine));
    REFUSED(ARGUMENT, visavis_engine_from_fd(-1, 0, 0, &engine));
    unlink(apk);
#endif

    REFUSED(IO, visavis_engine_from_path("/nowhere/model.safetensors", &engine));
    REFUSED(ARGUMENT, visavis_engine_from_path(NULL, &engine));
    REFUSED(ARGUMENT, visavis_engine_from_path("\xff\xfe", &engine));
    REFUSED(ARGUMENT, visavis_engine_from_path(path, NULL));
    REFUSED(ARGUMENT, visavis_engine_from_memory(NULL, 1, &engine));
}

static void options_and_versions(const visavis_engine *engine) {
    visavis_session *session = NULL;
    visavis_session_options options;
    OK(visavis_session_options_init(&options, sizeof options));
    CHECK(options.struct_size == sizeof options && options.threads == 1 && isnan(options.gaze));
    options.threads = 3;
    REFUSED(ARGUMENT, visavis_session_new(engine, &options, &session));
    CHECK(session == NULL);
    OK(visavis_session_options_init(&options, sizeof options));
    options.gaze = 2;
    REFUSED(ARGUMENT, visavis_session_new(engine, &options, &session));
    OK(visavis_session_options_init(&options, sizeof options));
    options.budget_ms = 1000;
    REFUSED(ARGUMENT, visavis_session_new(engine, &options, &session));
    OK(visavis_session_options_init(&options, sizeof options));
    CHECK(options.voice_ahead == 60);
    options.voice_ahead = 0.4;
    REFUSED(ARGUMENT, visavis_session_new(engine, &options, &session));
    options.voice_ahead = NAN;
    REFUSED(ARGUMENT, visavis_session_new(engine, &options, &session));
    options.voice_ahead = 0.5;
    OK(visavis_session_new(engine, &options, &session));
    float second[8000] = {0};
    visavis_stats stats = {.struct_size = sizeof stats};
    OK(visavis_session_push_agent_audio(session, second, 8000, 8000));
    OK(visavis_session_stats(session, &stats));
    CHECK(stats.agent_voice.overflow_samples > 11000 && stats.agent_voice.overflow_samples < 12100);
    visavis_session_free(session);
    OK(visavis_session_options_init(&options, sizeof options));
    options.sampler_kind = 77;
    REFUSED(ARGUMENT, visavis_session_new(engine, &options, &session));
    options.struct_size = 3;
    REFUSED(ABI, visavis_session_new(engine, &options, &session));

    /* A program that is newer than the library: what the library does not know must be zero. */
    struct {
        visavis_session_options known;
        uint64_t more;
    } newer;
    OK(visavis_session_options_init(&newer.known, sizeof newer));
    CHECK(newer.known.struct_size == sizeof newer && newer.more == 0);
    OK(visavis_session_new(engine, &newer.known, &session));
    visavis_session_free(session);
    newer.more = 1;
    REFUSED(ABI, visavis_session_new(engine, &newer.known, &session));

    OK(visavis_check_abi(VISAVIS_ABI_VERSION));
    REFUSED(ABI, visavis_check_abi(VISAVIS_ABI_VERSION + 1));
    REFUSED(ABI, visavis_check_abi(VISAVIS_ABI_VERSION + 0x10000));
    CHECK(visavis_abi_version() == VISAVIS_ABI_VERSION && strlen(visavis_version()) > 0);
}

/* Motion of `blocks` blocks; returns a digest. */
static uint64_t drive(const visavis_engine *engine, uint32_t threads, int blocks) {
    visavis_session_options options;
    visavis_session *session = NULL;
    OK(visavis_session_options_init(&options, sizeof options));
    options.threads = threads;
    options.gaze = 0.8f;
    OK(visavis_session_new(engine, &options, &session));
    OK(visavis_session_warm_up(session, 1));

    uint32_t joints_a_frame = visavis_engine_joint_count(engine), count;
    size_t all = VISAVIS_BLOCK_FRAMES * joints_a_frame;
    visavis_frame frames[VISAVIS_BLOCK_FRAMES];
    visavis_joint *joints = malloc(all * sizeof *joints);
    float voice[4410];
    for (int i = 0; i < 4410; i++) voice[i] = 0.2f * (float)((i * 7) % 100 - 50) / 50;
    uint64_t digest = 0xcbf29ce484222325u;
    for (int k = 0; k < blocks; k++) {
        double due;
        OK(visavis_session_next_due(session, &due));
        OK(visavis_session_push_agent_audio(session, voice, 4410, 44100));
        OK(visavis_session_push_user_audio(session, voice, 1600, 16000));
        OK(visavis_session_push_user_head(session, 0.1f * (float)k, 1.6f, 1.5f, due));
        OK(visavis_session_poll(session, due, frames, sizeof *frames, joints, all, &count));
        CHECK(count == VISAVIS_BLOCK_FRAMES && frames[3].index == (uint64_t)(4 * k + 3));
        for (size_t i = 0; i < all * sizeof *joints; i++) digest = (digest ^ ((const uint8_t *)joints)[i]) * 0x100000001b3u;
        OK(visavis_session_poll(session, due, frames, sizeof *frames, joints, all, &count));
        CHECK(count == 0);
    }
    visavis_stats stats = {.struct_size = sizeof stats};
    OK(visavis_session_stats(session, &stats));
    CHECK(stats.struct_size == sizeof stats && stats.blocks == (uint64_t)blocks && stats.head_accepted == (uint64_t)blocks);
    CHECK(stats.cache_bytes > 0 && stats.block_ms_max > 0);
    uint32_t ids[2];
    size_t id_count;
    OK(visavis_session_worker_thread_ids(session, ids, 2, &id_count));
    CHECK(id_count == (HAS_THREAD_IDS ? threads - 1 : 0));
    OK(visavis_session_worker_thread_ids(session, NULL, 0, &id_count));
    OK(visavis_session_push_user_pose(session, 0, 1.6f, 1.5f, 0, 0, 0, 1, 1e5));
    OK(visavis_session_dyadic(session, NULL, 0, &id_count));
    CHECK(id_count == 0);
    REFUSED(ARGUMENT, visavis_session_dyadic(session, NULL, 1, &id_count));
    REFUSED(ARGUMENT, visavis_session_dyadic(session, NULL, 0, NULL));

    /* Wrong uses of a live session. */
    REFUSED(ARGUMENT, visavis_session_poll(session, NAN, frames, sizeof *frames, joints, all, &count));
    REFUSED(STATE, visavis_session_poll(session, 0, frames, sizeof *frames, joints, all, &count));
    REFUSED(ARGUMENT, visavis_session_poll(session, 1e6, frames, sizeof *frames, joints, all - 1, &count));
    REFUSED(ARGUMENT, visavis_session_poll(session, 1e6, NULL, sizeof *frames, joints, all, &count));
    REFUSED(ABI, visavis_session_poll(session, 1e6, frames, sizeof *frames - 8, joints, all, &count));
    REFUSED(ARGUMENT, visavis_session_poll(session, 1e6, frames, sizeof *frames, joints, all, NULL));
    voice[3] = NAN;
    REFUSED(AUDIO, visavis_session_push_user_audio(session, voice, 10, 16000));
    REFUSED(AUDIO, visavis_session_push_user_audio(session, voice, 1, 7999));
    REFUSED(ARGUMENT, visavis_session_push_user_audio(session, NULL, 1, 16000));
    REFUSED(ARGUMENT, visavis_session_push_user_audio(session, (const float *)((const char *)voice + 1), 1, 16000));
    REFUSED(ARGUMENT, visavis_session_push_user_audio(session, voice, SIZE_MAX, 16000));
    REFUSED(ARGUMENT, visavis_session_set_gaze(session, NAN));
    REFUSED(ARGUMENT, visavis_session_set_guidance(session, -1, 0));
    REFUSED(ARGUMENT, visavis_session_set_sampler(session, VISAVIS_SAMPLER_KIND_EULER, 65));
    REFUSED(ARGUMENT, visavis_session_finish_audio(session, 2));
    stats.struct_size = 8;
    REFUSED(ABI, visavis_session_stats(session, &stats));
    OK(visavis_session_set_sampler(session, VISAVIS_SAMPLER_KIND_MIDPOINT, 2));
    OK(visavis_session_set_natural_gaze(session));
    OK(visavis_session_set_gaze(session, 1));
    OK(visavis_session_set_guidance(session, 1.3f, 2));
    REFUSED(ARGUMENT, visavis_session_set_budget(session, 0.5f));
    REFUSED(ARGUMENT, visavis_session_set_budget(session, NAN));
    REFUSED(ARGUMENT, visavis_session_report_block_time(session, -1));
    OK(visavis_session_set_budget(session, 100));
    OK(visavis_session_report_block_time(session, 5));
    OK(visavis_session_finish_audio(session, VISAVIS_VOICE_AGENT));
    OK(visavis_session_clear_audio(session, VISAVIS_VOICE_USER));
    OK(visavis_session_set_audio_present(session, VISAVIS_VOICE_USER, 0));
    /* Frames alone, and a frame that a newer program believes to be larger. */
    struct {
        visavis_frame known;
        uint64_t more;
    } larger[VISAVIS_BLOCK_FRAMES];
    OK(visavis_session_poll(session, 1e6, &larger[0].known, sizeof *larger, NULL, 0, &count));
    CHECK(count == VISAVIS_BLOCK_FRAMES && larger[3].more == 0 && larger[3].known.index == (uint64_t)(4 * blocks + 3));
    OK(visavis_session_reset(session));
    free(joints);
    visavis_session_free(session);
    return digest;
}

/* Another bundle, which lies beside the one at `path`. */
static visavis_engine *beside(const char *path, const char *name) {
    char at[4096];
    const char *slash = strrchr(path, '/');
    snprintf(at, sizeof at, "%.*s%s", slash ? (int)(slash + 1 - path) : 0, path, name);
    visavis_engine *engine = NULL;
    OK(visavis_engine_from_path(at, &engine));
    return engine;
}

/* Two blocks beside a bang at (x, 1, -2), pushed in `pieces`, if any; returns a digest of the hips. */
static uint64_t beside_a_bang(const visavis_engine *engine, int pieces, float x, float sensitivity) {
    float bang[9600];
    for (int i = 0; i < 9600; i++) bang[i] = (float)((i * 7919) % 2000 - 1000) / 1000 * (float)(9600 - i) / 9600 * 8;
    visavis_session *session = NULL;
    visavis_session_options options;
    OK(visavis_session_options_init(&options, sizeof options));
    options.sensitivity = sensitivity;
    OK(visavis_session_new(engine, &options, &session));
    for (int i = 0; i < pieces; i++)
        OK(visavis_session_push_sound(session, 7, bang + i * (9600 / pieces), 9600 / (size_t)pieces, 24000, x, 1, -2));
    visavis_frame frames[VISAVIS_BLOCK_FRAMES];
    uint64_t digest = 0xcbf29ce484222325u;
    for (int k = 0; k < 4; k++) {
        uint32_t count;
        OK(visavis_session_poll(session, 1, frames, sizeof *frames, NULL, 0, &count));
        for (size_t i = 0; i < sizeof frames; i++) digest = (digest ^ ((const uint8_t *)frames)[i]) * 0x100000001b3u;
    }
    visavis_stats stats = {.struct_size = sizeof stats};
    OK(visavis_session_stats(session, &stats));
    CHECK(stats.sound_pieces == (uint64_t)pieces && stats.sound_started == (pieces > 0) && stats.sound_refused == 0);
    visavis_session_free(session);
    return digest;
}

/* Sounds in the room: heard by a bundle with hearing, refused by the others. */
static void sounds(const visavis_engine *deaf, const char *path) {
    visavis_engine *engine = beside(path, "hearing.safetensors");
    visavis_session *session = NULL;
    float sound[960] = {0.5f};
    CHECK(visavis_engine_has_hearing(engine) == 1 && visavis_engine_has_hearing(deaf) == 0 && visavis_engine_has_hearing(NULL) == 0);
    uint64_t bang = beside_a_bang(engine, 1, 1, 0);
    CHECK(bang == beside_a_bang(engine, 4, 1, 0));
    CHECK(bang != beside_a_bang(engine, 0, 1, 0) && bang != beside_a_bang(engine, 1, -1, 0) && bang != beside_a_bang(engine, 1, 1, 1));

    OK(visavis_session_new(deaf, NULL, &session));
    REFUSED(ARGUMENT, visavis_session_push_sound(session, 1, sound, 960, 48000, 0, 1, 2));
    CHECK(strstr(visavis_last_error(), "hearing") != NULL);
    REFUSED(ARGUMENT, visavis_session_end_sound(session, 1));
    REFUSED(ARGUMENT, visavis_session_push_ears(session, sound, sound, 960, 48000));
    REFUSED(ARGUMENT, visavis_session_end_ears(session));
    OK(visavis_session_set_sensitivity(session, 1));
    visavis_session_free(session);

    visavis_session_options options;
    OK(visavis_session_options_init(&options, sizeof options));
    CHECK(options.sensitivity == 0);
    options.sensitivity = 1.6f;
    REFUSED(ARGUMENT, visavis_session_new(engine, &options, &session));
    options.sensitivity = NAN;
    REFUSED(ARGUMENT, visavis_session_new(engine, &options, &session));
    OK(visavis_session_new(engine, NULL, &session));
    visavis_engine_free(engine);
    REFUSED(ARGUMENT, visavis_session_set_sensitivity(session, -1.6f));
    REFUSED(ARGUMENT, visavis_session_set_sensitivity(session, NAN));
    OK(visavis_session_set_sensitivity(session, -1));
    REFUSED(ARGUMENT, visavis_session_push_sound(session, 1, sound, 960, 48000, NAN, 1, 2));
    REFUSED(ARGUMENT, visavis_session_push_sound(session, 1, sound, 960, 48000, 0, INFINITY, 2));
    REFUSED(AUDIO, visavis_session_push_sound(session, 1, sound, 960, 0, 0, 1, 2));
    REFUSED(ARGUMENT, visavis_session_push_sound(session, 1, NULL, 960, 48000, 0, 1, 2));
    REFUSED(ARGUMENT, visavis_session_push_sound(NULL, 1, sound, 960, 48000, 0, 1, 2));
    REFUSED(AUDIO, visavis_session_push_ears(session, sound, sound, 960, 0));
    REFUSED(ARGUMENT, visavis_session_push_ears(session, sound, NULL, 960, 48000));
    REFUSED(ARGUMENT, visavis_session_push_ears(NULL, sound, sound, 960, 48000));
    OK(visavis_session_push_ears(session, sound, sound, 960, 48000));
    OK(visavis_session_end_ears(session));
    OK(visavis_session_push_ears(session, NULL, NULL, 0, 48000));
    float place[3];
    int32_t known = -1;
    OK(visavis_session_heard_place(session, place, &known));
    CHECK(known == 0);
    REFUSED(ARGUMENT, visavis_session_heard_place(session, NULL, &known));
    REFUSED(ARGUMENT, visavis_session_heard_place(session, place, NULL));
    sound[3] = NAN;
    sound[4] = -65;
    REFUSED(AUDIO, visavis_session_push_sound(session, 1, sound, 960, 48000, 0, 1, 2));
    OK(visavis_session_push_sound(session, 1, NULL, 0, 48000, 0.5f, 1, 2));
    OK(visavis_session_end_sound(session, 1));
    OK(visavis_session_end_sound(session, 99));
    sound[3] = sound[4] = 0;
    /* Of a hundred sources 32 wait, and 16 sound; inside the head is 0.3 m from it. */
    for (uint32_t id = 100; id < 200; id++) OK(visavis_session_push_sound(session, id, sound, 960, 48000, 0, 1.6f, 0));
    visavis_frame frames[VISAVIS_BLOCK_FRAMES];
    uint32_t count;
    for (int k = 0; k < 3; k++) OK(visavis_session_poll(session, 1, frames, sizeof *frames, NULL, 0, &count));
    CHECK(isfinite(frames[3].hips[1]));
    OK(visavis_session_heard_place(session, place, &known));
    CHECK(known == 1 && place[0] == 0 && place[1] == 1.6f && place[2] == 0);
    visavis_stats stats = {.struct_size = sizeof stats};
    OK(visavis_session_stats(session, &stats));
    CHECK(stats.sound_bad_places == 2 && stats.sound_bad_rate_samples == 3 * 960 && stats.sound_non_finite_samples == 1);
    CHECK(stats.sound_clipped_samples == 1 && stats.sound_refused >= 84);
    visavis_session_free(session);
}

/* Blocks that come late are left to a bundle of the featherweight tier, which lies beside the first one. */
static void fallback(const visavis_engine *engine, const char *path) {
    visavis_session *session = NULL, *other = NULL;
    visavis_engine *light = beside(path, "dram-tcn.safetensors");
    visavis_session_options options;
    OK(visavis_session_options_init(&options, sizeof options));
    options.budget_ms = 100;
    OK(visavis_session_new(engine, &options, &session));
    OK(visavis_session_new(light, NULL, &other));
    REFUSED(ARGUMENT, visavis_session_set_fallback(session, engine));
    REFUSED(ARGUMENT, visavis_session_set_fallback(session, NULL));
    REFUSED(ARGUMENT, visavis_session_set_fallback(NULL, light));
    REFUSED(ARGUMENT, visavis_session_set_fallback(other, light));
    visavis_session_free(other);
    OK(visavis_session_set_fallback(session, light));
    visavis_engine_free(light);

    size_t all = VISAVIS_BLOCK_FRAMES * visavis_engine_joint_count(engine), told, none;
    float *shares = malloc(all * sizeof *shares);
    visavis_frame frames[VISAVIS_BLOCK_FRAMES];
    uint64_t fell = 0;
    for (int k = 0; k < 60; k++) {
        double due;
        uint32_t count;
        OK(visavis_session_next_due(session, &due));
        OK(visavis_session_poll(session, due, frames, sizeof *frames, NULL, 0, &count));
        OK(visavis_session_dyadic(session, shares, all, &told));
        CHECK(count == VISAVIS_BLOCK_FRAMES && (told == 0 || told == all));
        if (told) CHECK(shares[0] >= 0 && shares[all - 1] <= 1);
        if (told) REFUSED(ARGUMENT, visavis_session_dyadic(session, shares, all - 1, &none));
        fell += told > 0;
        OK(visavis_session_report_block_time(session, told ? 5 : 99999));
    }
    visavis_stats stats = {.struct_size = sizeof stats};
    OK(visavis_session_stats(session, &stats));
    CHECK(fell > 0 && stats.governor_fallback_blocks == fell && stats.governor_held_blocks == 0);
    free(shares);
    visavis_session_free(session);
}

static const visavis_engine *shared;
static visavis_session *contested;

static void *other_thread(void *digest) {
    *(uint64_t *)digest = drive(shared, 1, 4);
    return NULL;
}

/* Sound that two threads push at once. */
static float buffer[960];

/* Pushes and settings beside a thread that polls: each is done, none waits or is refused. */
static void *push(void *voice) {
    for (int i = 0; i < 2000; i++) {
        int which = *(int *)voice;
        if (which == VISAVIS_VOICE_AGENT) OK(visavis_session_push_agent_audio(contested, buffer, 960, 48000));
        else OK(visavis_session_push_user_audio(contested, buffer, 960, 48000));
        OK(visavis_session_push_user_head(contested, 0, 1.6f, 1.5f, 0.01 * (2 * i + which)));
        OK(visavis_session_set_gaze(contested, 0.5f));
        OK(visavis_session_set_guidance(contested, 1.3f, 2));
        OK(visavis_session_set_sampler(contested, VISAVIS_SAMPLER_KIND_MIDPOINT, 1u + (i & 1)));
        OK(visavis_session_set_budget(contested, 0));
        OK(visavis_session_report_block_time(contested, 1));
        if (i % 64 == 0) OK(visavis_session_clear_audio(contested, 1 - which));
        if (i % 64 == 1) OK(visavis_session_finish_audio(contested, 1 - which));
        if (i % 64 == 2) OK(visavis_session_set_audio_present(contested, 1 - which, 1));
    }
    return NULL;
}

int main(int argc, char **argv) {
    CHECK(argc == 2);
    loading(argv[1]);
    visavis_engine *engine = NULL;
    OK(visavis_engine_from_path(argv[1], &engine));
    options_and_versions(engine);
    fallback(engine, argv[1]);
    sounds(engine, argv[1]);

    CHECK(strlen(visavis_engine_name(engine)) > 0 && strcmp(visavis_engine_joint_name(engine, 0), "hips") == 0);
    CHECK(visavis_engine_joint_name(engine, 1000) == NULL && visavis_engine_joint_count(NULL) == 0);
    int32_t parent;
    float offset[3];
    OK(visavis_engine_joint(engine, 0, &parent, offset));
    CHECK(parent == -1 && offset[1] > 0.5f);
    OK(visavis_engine_joint(engine, 1, NULL, NULL));
    REFUSED(ARGUMENT, visavis_engine_joint(engine, 1000, &parent, offset));
    CHECK(visavis_engine_openxr_joint(engine, 0, VISAVIS_BODY_FB) == 1);
    CHECK(visavis_engine_openxr_joint(engine, 1000, VISAVIS_BODY_FB) == -1);
    CHECK(visavis_engine_joint_for_openxr(engine, 1) == 0 && visavis_engine_joint_for_openxr(engine, 0) == -1);
    CHECK(visavis_engine_joint_for_openxr(engine, 84) == -1);
    if (HAS_THREAD_IDS) OK(visavis_pin_current_thread(~0ull));
    REFUSED(ARGUMENT, visavis_pin_current_thread(0));
    CHECK((visavis_current_thread_id() != 0) == HAS_THREAD_IDS);

    /* The same motion with one thread, two threads, and two sessions at once on one engine. */
    uint64_t one = drive(engine, 1, 4), two = drive(engine, 2, 4), beside = 0;
    pthread_t thread;
    shared = engine;
    CHECK(pthread_create(&thread, NULL, other_thread, &beside) == 0);
    uint64_t meanwhile = drive(engine, 1, 4);
    pthread_join(thread, NULL);
    CHECK(one == two && one == beside && one == meanwhile);

    /* Two threads push from one buffer while a third polls. */
    OK(visavis_session_new(engine, NULL, &contested));
    pthread_t pushing[2];
    int voices[2] = {VISAVIS_VOICE_AGENT, VISAVIS_VOICE_USER};
    for (int i = 0; i < 960; i++) buffer[i] = 0.1f;
    for (int i = 0; i < 2; i++) CHECK(pthread_create(&pushing[i], NULL, push, &voices[i]) == 0);
    visavis_frame frames[VISAVIS_BLOCK_FRAMES];
    uint32_t count;
    for (int k = 0; k < 8; k++) {
        OK(visavis_session_poll(contested, 1e6, frames, sizeof *frames, NULL, 0, &count));
        CHECK(count == VISAVIS_BLOCK_FRAMES);
    }
    for (int i = 0; i < 2; i++) pthread_join(pushing[i], NULL);
    OK(visavis_session_poll(contested, 1e6, frames, sizeof *frames, NULL, 0, &count));
    visavis_stats stats = {.struct_size = sizeof stats};
    OK(visavis_session_stats(contested, &stats));
    CHECK(stats.head_accepted + stats.head_out_of_order + stats.head_overwritten >= 4000);
    /* Sound that met another thread inside the same voice is heard, or counted. */
    CHECK(stats.agent_contended_samples < 2000 * 960 && stats.agent_non_finite_samples == 0);

    /* A session outlives its engine. */
    visavis_engine_free(engine);
    OK(visavis_session_poll(contested, 1e6, frames, sizeof *frames, NULL, 0, &count));
    CHECK(count == VISAVIS_BLOCK_FRAMES);
    visavis_session_free(contested);
    visavis_session_free(NULL);
    visavis_engine_free(NULL);
    REFUSED(ARGUMENT, visavis_session_reset(NULL));
    REFUSED(ARGUMENT, visavis_session_new(NULL, NULL, &contested));
    printf("C smoke: all well; digest %016" PRIx64 "\n", one);
    return 0;
}
