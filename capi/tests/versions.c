/* A program and a library of two versions. The program knows the structs of its header, which are smaller than the library's, or larger
 * (compiled with -DNEWER). Arguments: the bundle, and `same`, `older` or `newer`: what the library is. */
#include "../examples/check.h"
#include <math.h>
#include <string.h>

/* Room behind a struct, which nobody may write to. */
#define BEYOND 64
#define GUARDED(type) struct { type known; unsigned char beyond[BEYOND]; }
#define INTACT(room) intact((room).beyond)

static int intact(const unsigned char *beyond) {
    for (int i = 0; i < BEYOND; i++)
        if (beyond[i] != 0xa5) return 0;
    return 1;
}

/* A session of what the program knows of the options; reads its statistics into `size` bytes, and its frames. */
static void use(const visavis_engine *engine, const visavis_session_options *options, uint32_t size) {
    visavis_session *session = NULL;
    OK(visavis_session_new(engine, options, &session));
    GUARDED(visavis_frame) frames[VISAVIS_BLOCK_FRAMES];
    struct { visavis_frame frames[VISAVIS_BLOCK_FRAMES]; unsigned char beyond[BEYOND]; } packed;
    memset(frames, 0xa5, sizeof frames);
    memset(&packed, 0xa5, sizeof packed);
    uint32_t count = 0;
    OK(visavis_session_poll(session, 0, packed.frames, sizeof(visavis_frame), NULL, 0, &count));
    CHECK(count == VISAVIS_BLOCK_FRAMES && packed.frames[3].index == 3 && packed.frames[3].time == 0.1 && INTACT(packed));
    /* A frame as it was first published. */
    unsigned char first[VISAVIS_BLOCK_FRAMES * 72 + BEYOND];
    memset(first, 0xa5, sizeof first);
    OK(visavis_session_poll(session, 0.2, (visavis_frame *)(void *)first, 72, NULL, 0, &count));
    uint64_t index;
    memcpy(&index, first + 3 * 72, sizeof index);
    CHECK(index == 7 && intact(first + VISAVIS_BLOCK_FRAMES * 72));
    REFUSED(ABI, visavis_session_poll(session, 1e6, packed.frames, 64, NULL, 0, &count));

    GUARDED(visavis_stats) stats;
    memset(&stats, 0xa5, sizeof stats);
    stats.known.struct_size = size;
    OK(visavis_session_stats(session, &stats.known));
    CHECK(stats.known.struct_size == size && stats.known.blocks == 2 && stats.known.guard_held_frames == 0 && INTACT(stats));
    visavis_session_free(session);
}

int main(int argc, char **argv) {
    CHECK(argc == 3);
    int older_library = strcmp(argv[2], "older") == 0;
    visavis_engine *engine = NULL;
    OK(visavis_engine_from_path(argv[1], &engine));
    OK(visavis_check_abi(VISAVIS_ABI_VERSION));
    /* Interface 1.0, the first. */
    OK(visavis_check_abi(0x10000));

    GUARDED(visavis_session_options) options;
    memset(&options, 0xa5, sizeof options);
    OK(visavis_session_options_init(&options.known, sizeof options.known));
    CHECK(options.known.struct_size == sizeof options.known && options.known.threads == 1 && isnan(options.known.gaze) && INTACT(options));
    use(engine, &options.known, sizeof(visavis_stats));

    /* As first published: fewer fields than this header has. */
    memset(&options, 0xa5, sizeof options);
    OK(visavis_session_options_init(&options.known, 88));
    CHECK(options.known.struct_size == 88 && options.known.guard == 1);
    use(engine, &options.known, 232);
    REFUSED(ABI, visavis_session_options_init(&options.known, 80));

#ifdef NEWER
    /* What this program would set in a library of its own age. */
    OK(visavis_session_options_init(&options.known, sizeof options.known));
    uint64_t default_ = options.known.grown;
    CHECK((default_ == 0) == older_library);
    options.known.grown = 5;
    visavis_session *session = NULL;
    if (older_library) REFUSED(ABI, visavis_session_new(engine, &options.known, &session));
    else REFUSED(ARGUMENT, visavis_session_new(engine, &options.known, &session));
    CHECK(session == NULL);
#endif
    if (older_library) REFUSED(ABI, visavis_check_abi(VISAVIS_ABI_VERSION + 1));
    visavis_engine_free(engine);
    printf("C versions: all well; structs of %zu, %zu and %zu bytes, %s library\n", sizeof(visavis_session_options),
           sizeof(visavis_frame), sizeof(visavis_stats), argv[2]);
    return 0;
}
