/* Four characters walk for some seconds on the server's clock, and the program prints their places.
 *
 *     walk http://127.0.0.1:8080 3
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "troupe.h"

#define COUNT 4

/* Prints the last error, and ends the program. */
static void fail(const char *what) {
    TroupeError error = {.size = sizeof error};
    troupe_last_error(&error);
    fprintf(stderr, "%s: %s\n", what, error.message);
    if (error.allowed[0] != 0) fprintf(stderr, "  %s may be: %s\n", error.field, error.allowed);
    exit(1);
}

int main(int argc, char **argv) {
    const char *url = argc > 1 ? argv[1] : "http://127.0.0.1:8080";
    double seconds = argc > 2 ? atof(argv[2]) : 3;
    if (troupe_abi_version() != TROUPE_ABI_VERSION) {
        fprintf(stderr, "header and library do not go together: build the program again\n");
        return 1;
    }

    TroupeConnectOptions to = {.size = sizeof to, .url = url};
    TroupeConnection connection;
    if (troupe_connect(&to, &connection) < 0) fail("connect");

    /* No name: the server's default pack. */
    TroupePackOptions which = {.size = sizeof which};
    TroupePack pack;
    if (troupe_pack_open(connection, &which, &pack) < 0) fail("pack");
    TroupePackInfo info = {.size = sizeof info};
    if (troupe_pack_info(pack, &info) < 0) fail("pack");
    printf("pack %s %s: %u joints, %u styles\n", info.name, info.version, info.joint_count, info.style_count);

    /* They stand in a row, two metres apart, each with a seed of its own. */
    TroupeCharacter characters[COUNT];
    memset(characters, 0, sizeof characters);
    for (uint32_t i = 0; i < COUNT; i++) {
        characters[i].seed = i + 1;
        characters[i].position.x = 2.0f * (float)i;
    }
    TroupeCrowdOptions options = {
        .size = sizeof options,
        .rate_hz = 30,
        .characters = characters,
        .character_count = COUNT,
        .character_size = sizeof(TroupeCharacter),
    };
    TroupeCrowd crowd;
    if (troupe_crowd_open(pack, &options, &crowd) < 0) fail("crowd");

    /* Ahead at 1.4 m/s. The command holds until another comes. */
    TroupeLocomotion ahead = {.size = sizeof ahead, .velocity = {.z = 1.4f}};
    for (uint32_t i = 0; i < COUNT; i++) {
        if (troupe_crowd_move(crowd, i, &ahead) < 0) fail("move");
    }

    /* A game reads once a frame and does not wait; this program waits for each tick. */
    TroupeFrames frames = {.size = sizeof frames};
    for (int ticks = 0; ticks < seconds * 30;) {
        TroupeStatus status = troupe_crowd_read(crowd, 1000, &frames);
        if (status < 0) fail("read");
        if (status == TROUPE_STATUS_OK && ticks++ % 30 == 0) {
            for (uint32_t i = 0; i < frames.character_count; i++) {
                const float *root = frames.root_positions + 3 * i;
                if (frames.present[i]) printf("  %u at %5.2f %5.2f %5.2f", i, root[0], root[1], root[2]);
            }
            printf("\n");
        }
        TroupeNote note = {.size = sizeof note};
        while (troupe_crowd_note(crowd, &note) == TROUPE_STATUS_OK) {
            printf("  note %u of character %u: %s\n", note.kind, note.character, note.message);
        }
    }

    troupe_crowd_close(crowd);
    troupe_pack_close(pack);
    troupe_connection_close(connection);
    return 0;
}
