/* Tests of the interface in C, against the server that TROUPE_SERVER names: errors, handles, frames, notes.
 * With TROUPE_FORWARDER and TROUPE_FORWARDER_PID (see forwarder.py) also a connection that breaks. */
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "troupe.h"

#ifdef COUNT_ALLOCATIONS
/* Counts what this thread allocates, the library's code included. */
extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
static _Thread_local unsigned long allocations;
void *malloc(size_t n) { allocations++; return __libc_malloc(n); }
void *calloc(size_t n, size_t of) { allocations++; return __libc_calloc(n, of); }
void *realloc(void *at, size_t n) { allocations++; return __libc_realloc(at, n); }
#endif

static TroupeError last(void) {
    TroupeError error = {.size = sizeof error};
    if (troupe_last_error(&error) != TROUPE_STATUS_OK) abort();
    return error;
}

#define CHECK(what)                                                                                   \
    do {                                                                                              \
        if (!(what)) {                                                                                \
            fprintf(stderr, "%s:%d: %s\n  last error: %s\n", __FILE__, __LINE__, #what, last().message); \
            exit(1);                                                                                  \
        }                                                                                             \
    } while (0)

/* A call fails with this code, about this field. */
#define FAILS(call, code, of)                                                                         \
    do {                                                                                              \
        TroupeStatus got = (call);                                                                    \
        TroupeError error = last();                                                                   \
        CHECK(got == (code) && error.status == (code));                                               \
        CHECK(strcmp(error.field, (of)) == 0);                                                        \
        CHECK(error.message[0] != 0);                                                                 \
    } while (0)

static TroupeConnection connect_to(const char *url) {
    TroupeConnectOptions options = {.size = sizeof options, .url = url};
    TroupeConnection connection;
    CHECK(troupe_connect(&options, &connection) == TROUPE_STATUS_OK);
    return connection;
}

static TroupePack default_pack(TroupeConnection connection) {
    TroupePackOptions options = {.size = sizeof options};
    TroupePack pack;
    CHECK(troupe_pack_open(connection, &options, &pack) == TROUPE_STATUS_OK);
    return pack;
}

static TroupeCrowd crowd_of(TroupePack pack, TroupeCrowdOptions options, uint32_t count) {
    TroupeCharacter characters[8];
    memset(characters, 0, sizeof characters);
    for (uint32_t i = 0; i < count; i++) {
        characters[i].seed = 1 + i;
        characters[i].position.x = 3.0f * (float)i;
    }
    options.size = sizeof options;
    options.characters = characters;
    options.character_count = count;
    options.character_size = sizeof *characters;
    TroupeCrowd crowd;
    CHECK(troupe_crowd_open(pack, &options, &crowd) == TROUPE_STATUS_OK);
    return crowd;
}

static void walk(TroupeCrowd crowd, uint32_t character, float x, float z) {
    TroupeLocomotion way = {.size = sizeof way, .velocity = {.x = x, .z = z}};
    CHECK(troupe_crowd_move(crowd, character, &way) == TROUPE_STATUS_OK);
}

/* Steps until a note of this kind comes, or for so many frames. */
static int step_until(TroupeCrowd crowd, TroupeNoteKind kind, TroupeNote *note, int frames) {
    TroupeFrames out = {.size = sizeof out};
    for (int at = 0; at < frames; at += 10) {
        CHECK(troupe_crowd_step(crowd, 10, &out) == TROUPE_STATUS_OK);
        while (troupe_crowd_note(crowd, note) == TROUPE_STATUS_OK) {
            if (note->kind == kind) return 1;
        }
    }
    return 0;
}

static void test_errors_without_a_server(void) {
    CHECK(troupe_abi_version() == TROUPE_ABI_VERSION);
    CHECK(strlen(troupe_version()) >= 5);
    CHECK(troupe_last_error(NULL) == TROUPE_STATUS_ARGUMENT);
    TroupeConnection connection = {0};
    TroupeConnectOptions options = {.size = sizeof options, .url = "ftp://a"};
    FAILS(troupe_connect(NULL, &connection), TROUPE_STATUS_ARGUMENT, "options");
    FAILS(troupe_connect(&options, NULL), TROUPE_STATUS_ARGUMENT, "out");
    FAILS(troupe_connect(&options, &connection), TROUPE_STATUS_ADDRESS, "options.url");
    CHECK(strstr(last().message, "only http:// and https://"));
    options.url = NULL;
    FAILS(troupe_connect(&options, &connection), TROUPE_STATUS_ARGUMENT, "options.url");
    options.url = "http://\xff";
    FAILS(troupe_connect(&options, &connection), TROUPE_STATUS_ARGUMENT, "options.url");
    options.url = "http://127.0.0.1:1";
    FAILS(troupe_connect(&options, &connection), TROUPE_STATUS_UNREACHABLE, "");
    options.certificate_file = "client.pem";
    FAILS(troupe_connect(&options, &connection), TROUPE_STATUS_ARGUMENT, "options.key_file");
    options.certificate_file = NULL;
    options.url = "https://127.0.0.1:1";
    options.ca_file = "/no/such/file.pem";
    FAILS(troupe_connect(&options, &connection), TROUPE_STATUS_CERTIFICATE, "");
    CHECK(strstr(last().message, "/no/such/file.pem"));
    options.size = 3;
    FAILS(troupe_connect(&options, &connection), TROUPE_STATUS_ARGUMENT, "size");
    CHECK(atoi(last().allowed) == sizeof options);
    CHECK(connection.id == 0);
}

static void test_handles_that_name_nothing(TroupeConnection connection) {
    TroupePack pack = {0};
    TroupeCrowd crowd = {0};
    TroupePackInfo info = {.size = sizeof info};
    TroupeFrames frames = {.size = sizeof frames};
    TroupeNote note = {.size = sizeof note};
    TroupePacks packs = {.size = sizeof packs};
    TroupeLocomotion stand = {.size = sizeof stand};
    FAILS(troupe_packs((TroupeConnection){0}, &packs), TROUPE_STATUS_HANDLE, "");
    FAILS(troupe_pack_info(pack, &info), TROUPE_STATUS_HANDLE, "");
    FAILS(troupe_pack_close(pack), TROUPE_STATUS_HANDLE, "");
    FAILS(troupe_crowd_move(crowd, 0, &stand), TROUPE_STATUS_HANDLE, "");
    FAILS(troupe_crowd_stand(crowd, 0), TROUPE_STATUS_HANDLE, "");
    FAILS(troupe_crowd_read(crowd, 0, &frames), TROUPE_STATUS_HANDLE, "");
    FAILS(troupe_crowd_step(crowd, 1, &frames), TROUPE_STATUS_HANDLE, "");
    FAILS(troupe_crowd_note(crowd, &note), TROUPE_STATUS_HANDLE, "");
    FAILS(troupe_crowd_close(crowd), TROUPE_STATUS_HANDLE, "");
    FAILS(troupe_connection_close((TroupeConnection){0}), TROUPE_STATUS_HANDLE, "");
    /* A handle of another kind. */
    pack.id = connection.id;
    FAILS(troupe_pack_info(pack, &info), TROUPE_STATUS_HANDLE, "");
    FAILS(troupe_packs(connection, NULL), TROUPE_STATUS_ARGUMENT, "out");
}

static void test_packs(TroupeConnection connection) {
    TroupePacks packs = {.size = sizeof packs};
    CHECK(troupe_packs(connection, &packs) == TROUPE_STATUS_OK && packs.count > 0);
    int found = 0;
    for (uint32_t i = 0; i < packs.count; i++) found |= strcmp(packs.names[i], packs.default_name) == 0;
    CHECK(found);

    TroupePack pack = default_pack(connection);
    TroupePackInfo info = {.size = sizeof info};
    CHECK(troupe_pack_info(pack, &info) == TROUPE_STATUS_OK);
    CHECK(info.joint_count > 1 && info.joint_parents[0] == -1 && info.style_count > 0);
    int style = 0;
    for (uint32_t i = 0; i < info.style_count; i++) style |= strcmp(info.style_names[i], info.default_style) == 0;
    CHECK(style && info.contact_count > 0 && info.contact_count <= 8);
    float longest = 0;
    for (uint32_t i = 1; i < info.joint_count; i++) {
        const float *offset = info.joint_offsets + 3 * i;
        CHECK(info.joint_parents[i] >= 0 && info.joint_parents[i] < (int32_t)i && info.joint_names[i][0] != 0);
        longest = fmaxf(longest, sqrtf(offset[0] * offset[0] + offset[1] * offset[1] + offset[2] * offset[2]));
    }
    CHECK(longest > 0.05f && longest < 1);

    TroupePackOptions unknown = {.size = sizeof unknown, .name = "no-such-pack"};
    TroupePack none = {0};
    FAILS(troupe_pack_open(connection, &unknown, &none), TROUPE_STATUS_REFUSED, last().field);
    CHECK(strstr(last().message, "no-such-pack") && none.id == 0);

    TroupeCharacter one = {.style = "no-such-style"};
    TroupeCrowdOptions options = {
        .size = sizeof options, .characters = &one, .character_count = 1, .character_size = sizeof one};
    TroupeCrowd crowd = {0};
    FAILS(troupe_crowd_open(pack, &options, &crowd), TROUPE_STATUS_REFUSED, "sessions[0].style");
    CHECK(strstr(last().message, "no-such-style") && strcmp(last().reason, "UNKNOWN_STYLE") == 0);
    options.rate_hz = 40;
    FAILS(troupe_crowd_open(pack, &options, &crowd), TROUPE_STATUS_ARGUMENT, "options.rate_hz");
    CHECK(strcmp(last().allowed, "30, 50 or 60") == 0);

    CHECK(troupe_pack_close(pack) == TROUPE_STATUS_OK);
    FAILS(troupe_pack_close(pack), TROUPE_STATUS_HANDLE, "");
    FAILS(troupe_crowd_open(pack, &options, &crowd), TROUPE_STATUS_HANDLE, "");
}

static void test_steps_on_the_callers_clock(TroupePack pack) {
    TroupeCrowdOptions by_caller = {.clock = TROUPE_CLOCK_CALLER, .joint_positions = 1};
    TroupeCrowd first = crowd_of(pack, by_caller, 2), second = crowd_of(pack, by_caller, 2);
    TroupeFrames a = {.size = sizeof a}, b = {.size = sizeof b};
    CHECK(troupe_crowd_read(first, 0, &a) == TROUPE_STATUS_EMPTY && a.present[0] == 0);
    walk(first, 0, 0, 9);
    walk(first, 0, 0, 1.4f); /* the newest counts */
    walk(second, 0, 0, 1.4f);
    CHECK(troupe_crowd_step(first, 60, &a) == TROUPE_STATUS_OK);
    CHECK(troupe_crowd_step(second, 60, &b) == TROUPE_STATUS_OK);
    CHECK(a.character_count == 2 && a.frame_count == 60 && a.rotation_size == 4 && a.tick == 0);
    size_t frames = 2 * 60, joints = a.joint_count;
    CHECK(a.present[0] && a.present[1]);
    CHECK(memcmp(a.root_positions, b.root_positions, frames * 3 * sizeof(float)) == 0);
    CHECK(memcmp(a.rotations, b.rotations, frames * joints * 4 * sizeof(float)) == 0);
    CHECK(memcmp(a.contacts, b.contacts, frames) == 0);
    const float *walked = a.root_positions + 3 * 59, *stood = a.root_positions + 3 * 119;
    CHECK(walked[2] > 1 && fabsf(walked[0]) < 0.5f && walked[1] > 0.5f);
    CHECK(fabsf(stood[0] - 3) < 0.3f && fabsf(stood[2]) < 0.3f);
    for (size_t i = 0; i < frames * joints; i++) {
        const float *q = a.rotations + 4 * i;
        CHECK(fabsf(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1) < 1e-3f);
    }
    for (size_t i = 0; i < frames; i++) {
        CHECK(memcmp(a.joint_positions + 3 * i * joints, a.root_positions + 3 * i, 3 * sizeof(float)) == 0);
    }
    CHECK(troupe_crowd_step(first, 1, &a) == TROUPE_STATUS_OK && a.tick == 1 && a.first_frames[0] == b.first_frames[0] + 60);
    FAILS(troupe_crowd_step(first, 121, &a), TROUPE_STATUS_ARGUMENT, "frames");
    a.size = 1;
    FAILS(troupe_crowd_step(first, 1, &a), TROUPE_STATUS_ARGUMENT, "size");
    CHECK(troupe_crowd_close(first) == TROUPE_STATUS_OK);
    FAILS(troupe_crowd_close(first), TROUPE_STATUS_HANDLE, "");
    CHECK(troupe_crowd_close(second) == TROUPE_STATUS_OK);
}

static void test_commands_and_notes(TroupePack pack) {
    TroupeCrowd crowd = crowd_of(pack, (TroupeCrowdOptions){.clock = TROUPE_CLOCK_CALLER}, 1);
    TroupeNote note = {.size = sizeof note};
    FAILS(troupe_crowd_stand(crowd, 1), TROUPE_STATUS_ARGUMENT, "character");
    CHECK(strcmp(last().allowed, "0 to 0") == 0);
    FAILS(troupe_crowd_move(crowd, 0, NULL), TROUPE_STATUS_ARGUMENT, "locomotion");
    TroupeLocomotion odd = {.size = sizeof odd, .set = TROUPE_SET_TIME};
    FAILS(troupe_crowd_move(crowd, 0, &odd), TROUPE_STATUS_ARGUMENT, "set");
    FAILS(troupe_crowd_interact(crowd, 0, NULL, NULL, NULL), TROUPE_STATUS_ARGUMENT, "object");

    TroupeLocomotion wrong = {.size = sizeof wrong, .velocity = {.z = 1}, .style = "no-such-style"};
    CHECK(troupe_crowd_move(crowd, 0, &wrong) == TROUPE_STATUS_OK);
    CHECK(step_until(crowd, TROUPE_NOTE_KIND_REFUSED, &note, 10));
    CHECK(note.character == 0 && strstr(note.message, "no-such-style") && strstr(note.subject, "style"));

    TroupePathPoint points[2] = {{.position = {.z = 0}}, {.position = {.z = 2}}};
    TroupePath path = {.size = sizeof path, .points = points, .point_count = 1, .point_size = sizeof *points};
    FAILS(troupe_crowd_follow_path(crowd, 0, &path), TROUPE_STATUS_ARGUMENT, "path.point_count");
    path.point_count = 2;
    CHECK(troupe_crowd_follow_path(crowd, 0, &path) == TROUPE_STATUS_OK);
    CHECK(step_until(crowd, TROUPE_NOTE_KIND_ARRIVED, &note, 300));
    CHECK(note.values[1] < 0.5f && note.frame > 30);

    CHECK(troupe_crowd_go_to(crowd, 0, (TroupeVec3){.x = 2, .z = 2}, 0, NULL) == TROUPE_STATUS_OK);
    CHECK(step_until(crowd, TROUPE_NOTE_KIND_ARRIVED, &note, 300));
    TroupeFrames frames = {.size = sizeof frames};
    CHECK(troupe_crowd_read(crowd, 0, &frames) == TROUPE_STATUS_EMPTY);
    const float *root = frames.root_positions + 3 * (frames.frame_count - 1);
    CHECK(hypotf(root[0] - 2, root[2] - 2) < 0.5f);

    for (int i = 0; i < 16; i++) CHECK(troupe_crowd_drop(crowd, 0) == TROUPE_STATUS_OK);
    FAILS(troupe_crowd_drop(crowd, 0), TROUPE_STATUS_FULL, "");
    CHECK(troupe_crowd_close(crowd) == TROUPE_STATUS_OK);
}

static void test_the_servers_clock(TroupePack pack) {
    TroupeCrowdOptions options = {.rate_hz = 60, .rotation = TROUPE_ROTATION_SIX_D};
    TroupeCrowd crowd = crowd_of(pack, options, 4);
    TroupeFrames frames = {.size = sizeof frames};
    FAILS(troupe_crowd_step(crowd, 1, &frames), TROUPE_STATUS_ARGUMENT, "options.clock");
    for (uint32_t i = 0; i < 4; i++) walk(crowd, i, 0, 1.4f);
    TroupePackInfo info = {.size = sizeof info};
    CHECK(troupe_pack_info(pack, &info) == TROUPE_STATUS_OK);
    uint64_t before = 0;
    int ticks = 0;
    float start = 0, way = 0;
    /* A busy server is slow, and characters with it. */
    for (int tries = 0; (ticks < 60 || way < 1) && tries < 3000; tries++) {
        TroupeStatus status = troupe_crowd_read(crowd, 1000, &frames);
        CHECK(status >= 0);
        if (status == TROUPE_STATUS_EMPTY || !frames.present[3]) continue;
        CHECK(frames.rate_hz == 60 && frames.frame_count == 1 && frames.rotation_size == 6);
        CHECK(ticks == 0 || frames.tick > before);
        before = frames.tick;
        if (ticks++ == 0) start = frames.root_positions[11];
        way = frames.root_positions[11] - start;
        const float *m = frames.rotations;
        CHECK(fabsf(m[0] * m[0] + m[1] * m[1] + m[2] * m[2] - 1) < 1e-3f);
        CHECK(fabsf(m[0] * m[3] + m[1] * m[4] + m[2] * m[5]) < 1e-3f);
#ifdef COUNT_ALLOCATIONS
        unsigned long count = allocations;
        CHECK(troupe_crowd_read(crowd, 40, &frames) >= 0);
        CHECK(allocations == count);
        TroupeLocomotion styled = {.size = sizeof styled, .velocity = {.z = 1.4f}, .style = info.default_style};
        CHECK(troupe_crowd_move(crowd, 0, &styled) == TROUPE_STATUS_OK);
        CHECK(allocations > count); /* the library's are counted */
#endif
    }
    CHECK(ticks >= 60 && way >= 1);
    CHECK(troupe_crowd_close(crowd) == TROUPE_STATUS_OK);
    FAILS(troupe_crowd_read(crowd, 0, &frames), TROUPE_STATUS_HANDLE, "");
}

static volatile int done;

static void *reads(void *of) {
    TroupeCrowd crowd = *(TroupeCrowd *)of;
    TroupeFrames frames = {.size = sizeof frames};
    while (!done) troupe_crowd_read(crowd, 1000, &frames);
    return NULL;
}

static void test_a_second_thread_is_refused(TroupePack pack) {
    TroupeCrowd crowd = crowd_of(pack, (TroupeCrowdOptions){0}, 1);
    pthread_t thread;
    CHECK(pthread_create(&thread, NULL, reads, &crowd) == 0);
    TroupeNote note = {.size = sizeof note};
    TroupeStatus status = TROUPE_STATUS_OK;
    for (int i = 0; i < 100000000 && status != TROUPE_STATUS_BUSY; i++) status = troupe_crowd_note(crowd, &note);
    CHECK(status == TROUPE_STATUS_BUSY);
    walk(crowd, 0, 1, 0); /* commands may come from any thread */
    done = 1;
    pthread_join(thread, NULL);
    CHECK(troupe_crowd_close(crowd) == TROUPE_STATUS_OK);
}

static void test_a_connection_that_breaks(const char *url, int forwarder) {
    TroupeConnection connection = connect_to(url);
    TroupePack pack = default_pack(connection);
    TroupeCrowd crowd = crowd_of(pack, (TroupeCrowdOptions){0}, 2);
    TroupeCrowd brittle = crowd_of(pack, (TroupeCrowdOptions){.reconnect_ms = TROUPE_NEVER}, 1);
    TroupeFrames frames = {.size = sizeof frames};
    for (int i = 0; i < 30; i++) CHECK(troupe_crowd_read(crowd, 5000, &frames) == TROUPE_STATUS_OK);
    uint64_t before = frames.first_frames[1];
    CHECK(kill(forwarder, SIGUSR1) == 0);
    int resumed = 0;
    for (int i = 0; i < 300 && resumed < 2; i++) {
        walk(crowd, 0, 0, i % 2 ? 1.0f : 1.2f); /* commands do not hinder it */
        CHECK(troupe_crowd_read(crowd, 100, &frames) >= 0);
        TroupeNote note = {.size = sizeof note};
        while (troupe_crowd_note(crowd, &note) == TROUPE_STATUS_OK) resumed += note.kind == TROUPE_NOTE_KIND_RESUMED;
    }
    CHECK(resumed == 2);
    for (int i = 0; i < 30; i++) CHECK(troupe_crowd_read(crowd, 5000, &frames) == TROUPE_STATUS_OK);
    CHECK(frames.present[0] && frames.present[1] && frames.first_frames[1] > before);
    CHECK(troupe_crowd_close(crowd) == TROUPE_STATUS_OK);

    TroupeStatus status = TROUPE_STATUS_OK;
    for (int i = 0; i < 100 && status >= 0; i++) status = troupe_crowd_read(brittle, 1000, &frames);
    FAILS(status, TROUPE_STATUS_UNREACHABLE, "");
    CHECK(strstr(last().message, "close it, and open another"));
    TroupeNote note = {.size = sizeof note};
    CHECK(troupe_crowd_note(brittle, &note) == TROUPE_STATUS_OK);
    CHECK(note.kind == TROUPE_NOTE_KIND_ENDED && note.character == TROUPE_NO_CHARACTER);
    CHECK(troupe_crowd_close(brittle) == TROUPE_STATUS_OK);
    CHECK(troupe_pack_close(pack) == TROUPE_STATUS_OK);
    CHECK(troupe_connection_close(connection) == TROUPE_STATUS_OK);
}

int main(void) {
    const char *url = getenv("TROUPE_SERVER");
    test_errors_without_a_server();
    CHECK(url != NULL);
    TroupeConnection connection = connect_to(url);
    test_handles_that_name_nothing(connection);
    test_packs(connection);
    TroupePack pack = default_pack(connection);
    test_steps_on_the_callers_clock(pack);
    test_commands_and_notes(pack);
    test_the_servers_clock(pack);
    test_a_second_thread_is_refused(pack);

    /* What is open keeps what it needs. */
    TroupeCrowd crowd = crowd_of(pack, (TroupeCrowdOptions){.clock = TROUPE_CLOCK_CALLER}, 1);
    CHECK(troupe_pack_close(pack) == TROUPE_STATUS_OK);
    CHECK(troupe_connection_close(connection) == TROUPE_STATUS_OK);
    FAILS(troupe_connection_close(connection), TROUPE_STATUS_HANDLE, "");
    TroupeFrames frames = {.size = sizeof frames};
    CHECK(troupe_crowd_step(crowd, 3, &frames) == TROUPE_STATUS_OK);
    CHECK(troupe_crowd_close(crowd) == TROUPE_STATUS_OK);

    const char *forwarder = getenv("TROUPE_FORWARDER"), *pid = getenv("TROUPE_FORWARDER_PID");
    if (forwarder && pid) test_a_connection_that_breaks(forwarder, atoi(pid));
    printf("the C interface passes its tests%s\n", forwarder ? "" : ", without a connection that breaks");
    return 0;
}
