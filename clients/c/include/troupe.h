/*
 * Troupe: live characters of a motion server, in C.
 *
 * This file is made by cbindgen from clients/c/src. docs/tutorials/c.md begins from nothing.
 *
 * CALLS. Every call returns a TroupeStatus: zero if it worked, negative for an error. After an error,
 * troupe_last_error says which field is at fault, what is allowed, and what to do. Errors are kept for each
 * thread. No call ends the program, and none throws. Calls that ask the server block until it answers, or
 * until the time of the options is over.
 *
 * STRUCTURES. Set every structure to zero, and then its `size` to its sizeof. Zero is the default of each
 * field. So a program runs with a library of another version; a library refuses a newer structure only if it
 * uses fields that the library does not know. Check troupe_abi_version() == TROUPE_ABI_VERSION first.
 *
 * HANDLES. A handle is a number. Zero, a closed one and one of another kind are errors. Close each once;
 * closing again is an error, and harms nothing. Connections, packs and crowds may be closed in any order.
 *
 * THREADS. A connection has one thread of its own for all of its crowds. Commands (troupe_crowd_move,
 * troupe_crowd_stand, and so on) and troupe_pack_info may come from any thread at any time. All other calls
 * with one handle must come from one thread at a time; otherwise the later one is refused with
 * TROUPE_STATUS_BUSY, and what the earlier one gave stays valid. Do not fork with an open connection.
 *
 * MEMORY. Nothing that a call gives is to be freed. Each structure says how long its texts and arrays hold.
 * Texts are UTF-8. Those that go in are copied.
 *
 * UNITS. Metres, radians, seconds. Right-handed: X to the left of a character that faces ahead, Y up, Z ahead.
 * Angles about Y count from +Z towards +X. Rotations are relative to the parent, and those of the first joint to
 * the world. A joint's own axes are those of the world while it is not turned. clients/conventions/poses.json has
 * known poses in this frame, and in those of Unity, Unreal and Godot.
 */


#ifndef TROUPE_H
#define TROUPE_H

#include <stdint.h>


/*
 Version of this interface. Functions and fields are added with the same version. Any other
 change gives another version.
 */
#define TROUPE_ABI_VERSION 1

/*
 In `set`: `facing` counts.
 */
#define TROUPE_SET_FACING 1

/*
 In `set`: `height` counts.
 */
#define TROUPE_SET_HEIGHT 2

/*
 In `set`: `heading` counts.
 */
#define TROUPE_SET_HEADING 4

/*
 In `set`: `time_s` counts.
 */
#define TROUPE_SET_TIME 8

/*
 In `set`: `temperature` counts.
 */
#define TROUPE_SET_TEMPERATURE 16

/*
 The `character` of notes that are about the whole crowd.
 */
#define TROUPE_NO_CHARACTER 4294967295

/*
 Characters of a crowd, at most.
 */
#define TROUPE_MOST_CHARACTERS 1024

/*
 For times: never.
 */
#define TROUPE_NEVER 4294967295

/*
 What a call came to. Errors are negative; `troupe_last_error` says more about them.
 */
enum TroupeStatus
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   It worked.
   */
  TROUPE_STATUS_OK = 0,
  /*
   Nothing new has come: no frame, or no note. This is no error.
   */
  TROUPE_STATUS_EMPTY = 1,
  /*
   An argument cannot be used: `field` names it, `allowed` says what can.
   */
  TROUPE_STATUS_ARGUMENT = -1,
  /*
   The handle is zero, of another kind, or closed.
   */
  TROUPE_STATUS_HANDLE = -2,
  /*
   Another thread is in a call with this handle.
   */
  TROUPE_STATUS_BUSY = -3,
  /*
   The address of the server cannot be used.
   */
  TROUPE_STATUS_ADDRESS = -4,
  /*
   A certificate or its key cannot be read.
   */
  TROUPE_STATUS_CERTIFICATE = -5,
  /*
   No server answers, or the connection broke.
   */
  TROUPE_STATUS_UNREACHABLE = -6,
  /*
   The server did not answer in time.
   */
  TROUPE_STATUS_TIMED_OUT = -7,
  /*
   The server refused the call: `field` and `allowed` say what to change.
   */
  TROUPE_STATUS_REFUSED = -8,
  /*
   A session is gone, or another client advances it.
   */
  TROUPE_STATUS_SESSION = -9,
  /*
   The server ended the stream. Open another crowd.
   */
  TROUPE_STATUS_STREAM_ENDED = -10,
  /*
   The request cannot be built.
   */
  TROUPE_STATUS_REQUEST = -11,
  /*
   The answer of the server cannot be read: client and server are of different versions.
   */
  TROUPE_STATUS_ANSWER = -12,
  /*
   Too many commands of a character wait to be sent.
   */
  TROUPE_STATUS_FULL = -13,
  /*
   The system has no thread or socket for a connection.
   */
  TROUPE_STATUS_SYSTEM = -14,
  /*
   A defect of the library. Close the handle.
   */
  TROUPE_STATUS_PANIC = -15,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum TroupeStatus TroupeStatus;
#else
typedef int32_t TroupeStatus;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 What a note is about. The columns of the table are fields of `TroupeNote`.

 | kind | subject | detail | values |
 |---|---|---|---|
 | `RESUMED` | | | commands that were lost; 1 if the server was restarted |
 | `LEFT` | | the server's word for the reason | |
 | `REFUSED` | field of the command | the server's word for the reason | |
 | `ENDED` | | | |
 | `STARTED` | object | definition, or skill | |
 | `SET_ENTERED` | object | set | |
 | `KEYFRAME_REACHED` | object | set | index of the keyframe; distance of the root, metres |
 | `OBJECT_ATTACHED` | object | socket | |
 | `OBJECT_RELEASED` | object | | |
 | `DONE`, `INTERRUPTED` | object | | |
 | `FAILED` | object | reason, such as `BLOCKED` | |
 | `FELL` | | | height, metres |
 | `LANDED` | | | height, metres; speed, metres a second |
 | `ARRIVED` | | | delay, seconds; distance from the last point, metres |
 | `PERFORMING` | sentence | pack | |
 | `PERFORMED` | | reason, such as `DONE` | |
 | `BOUNDED` | | | wanted speed and speed, metres a second |
 */
enum TroupeNoteKind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   A kind that this library does not know.
   */
  TROUPE_NOTE_KIND_OTHER = 0,
  /*
   The connection broke, and the character goes on after the last frame that came.
   */
  TROUPE_NOTE_KIND_RESUMED = 1,
  /*
   The character left the crowd: its session is gone. It has no frames from now on.
   */
  TROUPE_NOTE_KIND_LEFT = 2,
  /*
   The server refused a command. The character goes on as before.
   */
  TROUPE_NOTE_KIND_REFUSED = 3,
  /*
   The stream ended, and no frames come from now on. `character` is `TROUPE_NO_CHARACTER`.
   */
  TROUPE_NOTE_KIND_ENDED = 4,
  /*
   An interaction or a skill began.
   */
  TROUPE_NOTE_KIND_STARTED = 5,
  /*
   A set of keyframes began.
   */
  TROUPE_NOTE_KIND_SET_ENTERED = 6,
  /*
   The character reached a keyframe.
   */
  TROUPE_NOTE_KIND_KEYFRAME_REACHED = 7,
  /*
   The object is in the character's hand.
   */
  TROUPE_NOTE_KIND_OBJECT_ATTACHED = 8,
  /*
   The character put the object down.
   */
  TROUPE_NOTE_KIND_OBJECT_RELEASED = 9,
  /*
   An interaction ended as planned.
   */
  TROUPE_NOTE_KIND_DONE = 10,
  /*
   An interaction failed, and the character stands.
   */
  TROUPE_NOTE_KIND_FAILED = 11,
  /*
   A command broke an interaction off.
   */
  TROUPE_NOTE_KIND_INTERRUPTED = 12,
  /*
   The ground ended, and the character falls.
   */
  TROUPE_NOTE_KIND_FELL = 13,
  /*
   The character landed.
   */
  TROUPE_NOTE_KIND_LANDED = 14,
  /*
   The character came to the end of its path, and stands there.
   */
  TROUPE_NOTE_KIND_ARRIVED = 15,
  /*
   The character began to act out a sentence.
   */
  TROUPE_NOTE_KIND_PERFORMING = 16,
  /*
   A performance ended.
   */
  TROUPE_NOTE_KIND_PERFORMED = 17,
  /*
   A command asks for more than the style can do. The character does what comes nearest.
   */
  TROUPE_NOTE_KIND_BOUNDED = 18,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum TroupeNoteKind TroupeNoteKind;
#else
typedef uint32_t TroupeNoteKind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 Who advances a crowd.
 */
enum TroupeClock
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   The server, at a steady rate. Read the newest frames when you want them.
   */
  TROUPE_CLOCK_SERVER = 0,
  /*
   The caller, with `troupe_crowd_step`. The same seeds, commands and steps give the same
   frames.
   */
  TROUPE_CLOCK_CALLER = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum TroupeClock TroupeClock;
#else
typedef uint32_t TroupeClock;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 Form of rotations.
 */
enum TroupeRotation
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /*
   Unit quaternions: x, y, z, w.
   */
  TROUPE_ROTATION_QUATERNION = 0,
  /*
   The first two columns of the matrix: six numbers.
   */
  TROUPE_ROTATION_SIX_D = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum TroupeRotation TroupeRotation;
#else
typedef uint32_t TroupeRotation;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/*
 How to connect. Fields that are zero take their defaults.
 */
typedef struct TroupeConnectOptions {
  /*
   `sizeof(TroupeConnectOptions)`.
   */
  uint32_t size;
  /*
   Time to open the connection, milliseconds. Zero: 5000.
   */
  uint32_t connect_timeout_ms;
  /*
   Time for a call, from its first byte to the last of the answer, milliseconds. Zero: 60000.
   */
  uint32_t request_timeout_ms;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   Address of the server, such as `http://127.0.0.1:8080`. Addresses with `https://` use TLS.
   */
  const char *url;
  /*
   Key of the client, if the server asks for one.
   */
  const char *key;
  /*
   File (PEM) with the certificates of the authorities to trust. Null: those of the system.
   */
  const char *ca_file;
  /*
   File (PEM) with the client's certificate, for a server that asks for one. It goes with
   `key_file`.
   */
  const char *certificate_file;
  /*
   File (PEM) with the private key of `certificate_file`.
   */
  const char *key_file;
} TroupeConnectOptions;

/*
 A connection to a server. Zero is none.
 */
typedef struct TroupeConnection {
  /*
   The number of the handle.
   */
  uint64_t id;
} TroupeConnection;

/*
 The packs of a server. Texts and array hold until the next `troupe_packs` with this connection,
 or until it is closed.
 */
typedef struct TroupePacks {
  /*
   `sizeof(TroupePacks)`.
   */
  uint32_t size;
  /*
   Number of packs.
   */
  uint32_t count;
  /*
   Names that `troupe_pack_open` takes: `count` of them.
   */
  const char *const *names;
  /*
   Name of the server's default pack. Empty: it has none.
   */
  const char *default_name;
} TroupePacks;

/*
 A pack of a server, on one skeleton. Zero is none.
 */
typedef struct TroupePack {
  /*
   The number of the handle.
   */
  uint64_t id;
} TroupePack;

/*
 Three numbers.
 */
typedef struct TroupeVec3 {
  /*
   To a character's left that faces ahead.
   */
  float x;
  /*
   Up.
   */
  float y;
  /*
   Ahead.
   */
  float z;
} TroupeVec3;

/*
 A character of a new crowd. Fields that are zero take their defaults.
 */
typedef struct TroupeCharacter {
  /*
   The same seed, commands and steps give the same frames. Any seed but zero gives the
   character a posture and a gait of its own.
   */
  uint64_t seed;
  /*
   Where it stands at first, metres. Its height is the pack's.
   */
  struct TroupeVec3 position;
  /*
   What it faces at first, radians about the Y axis: 0 is +Z, a quarter turn is +X.
   */
  float heading;
  /*
   Its first style. Default: the pack's.
   */
  const char *style;
} TroupeCharacter;

/*
 What a crowd is opened with. Fields that are zero take their defaults.
 */
typedef struct TroupeCrowdOptions {
  /*
   `sizeof(TroupeCrowdOptions)`.
   */
  uint32_t size;
  /*
   A `TroupeClock`.
   */
  uint32_t clock;
  /*
   Frames a second: 30, 50 or 60. Zero: 30.
   */
  uint32_t rate_hz;
  /*
   A `TroupeRotation`.
   */
  uint32_t rotation;
  /*
   1: frames have the joints' positions in the world, too.
   */
  uint32_t joint_positions;
  /*
   Time without a step or stream after which the server closes a character, milliseconds: 1000
   to 86400000. Zero: a minute.
   */
  uint32_t ttl_ms;
  /*
   On the server's clock, the time for which a connection that breaks is opened again, to go on
   after the last frame that came, milliseconds. Zero: 10000. `TROUPE_NEVER`: the crowd ends.
   */
  uint32_t reconnect_ms;
  /*
   Number of `characters`: 1 to `TROUPE_MOST_CHARACTERS`.
   */
  uint32_t character_count;
  /*
   `sizeof(TroupeCharacter)`.
   */
  uint32_t character_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   Who is in it: `character_count` of them.
   */
  const struct TroupeCharacter *characters;
  /*
   Name of the scene on the server that they live in. Default: none, flat ground.
   */
  const char *scene;
} TroupeCrowdOptions;

/*
 Characters of one pack. Zero is none.
 */
typedef struct TroupeCrowd {
  /*
   The number of the handle.
   */
  uint64_t id;
} TroupeCrowd;

/*
 The newest frames of a crowd, in place: nothing is copied. The columns hold until the next
 `troupe_crowd_read`, `troupe_crowd_step` or `troupe_crowd_close` of this crowd. Do not write to
 them.

 With C characters, F frames each and J joints, every column has all frames of character 0, then
 all of character 1, and so on.
 */
typedef struct TroupeFrames {
  /*
   `sizeof(TroupeFrames)`.
   */
  uint32_t size;
  /*
   C: characters of the crowd, those without frames too.
   */
  uint32_t character_count;
  /*
   F: frames of each character. 1 on the server's clock; as many as the step asked for on the
   caller's.
   */
  uint32_t frame_count;
  /*
   J: joints of the pack.
   */
  uint32_t joint_count;
  /*
   Numbers of a rotation: 4 for quaternions, 6 for the 6D form.
   */
  uint32_t rotation_size;
  /*
   Frames a second.
   */
  uint32_t rate_hz;
  /*
   Number of the tick or step, from 0.
   */
  uint64_t tick;
  /*
   Ticks so far that this caller did not get, because newer ones had come.
   */
  uint64_t missed_ticks;
  /*
   C: 1 for a character with frames here; 0 for one without, whose rows mean nothing.
   */
  const uint8_t *present;
  /*
   C: number of each character's first frame on its own timeline, which has 30 frames a second.
   */
  const uint64_t *first_frames;
  /*
   C x F x 3: position of the first joint in the world, metres.
   */
  const float *root_positions;
  /*
   C x F x J x `rotation_size`: of the first joint in the world, of the others relative to
   their parents. Quaternions are x, y, z, w, have unit length, and begin at multiples of 16
   bytes. The 6D form is the first two columns of the matrix: x, y, z of the first, then of the
   second.
   */
  const float *rotations;
  /*
   C x F: bit n is set while contact joint n of the pack is on the ground.
   */
  const uint8_t *contacts;
  /*
   C x F x J x 3: positions of the joints in the world, metres. Null, unless the options ask
   for them.
   */
  const float *joint_positions;
} TroupeFrames;

/*
 Something that happened. Its texts are UTF-8, never null, and hold until the next
 `troupe_crowd_note` or `troupe_crowd_close` of this crowd.
 */
typedef struct TroupeNote {
  /*
   `sizeof(TroupeNote)`.
   */
  uint32_t size;
  /*
   What it is about.
   */
  TroupeNoteKind kind;
  /*
   Index of the character, or `TROUPE_NO_CHARACTER`.
   */
  uint32_t character;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   Frame of the character's timeline, which has 30 frames a second.
   */
  uint64_t frame;
  /*
   Notes of this crowd that were dropped so far, because they were not taken.
   */
  uint64_t dropped;
  /*
   See `TroupeNoteKind`.
   */
  const char *subject;
  /*
   See `TroupeNoteKind`.
   */
  const char *detail;
  /*
   A sentence for people, for refusals and failures.
   */
  const char *message;
  /*
   See `TroupeNoteKind`.
   */
  float values[2];
} TroupeNote;

/*
 How to move over the ground. All zeros: stand, in the current style.
 */
typedef struct TroupeLocomotion {
  /*
   `sizeof(TroupeLocomotion)`.
   */
  uint32_t size;
  /*
   `TROUPE_SET_FACING` and `TROUPE_SET_HEIGHT`, added up.
   */
  uint32_t set;
  /*
   Velocity over the ground, metres a second in the world. Zero: stand.
   */
  struct TroupeVec3 velocity;
  /*
   What to face, radians about the Y axis: 0 is +Z. Not set: the way it goes.
   */
  float facing;
  /*
   Height of the first joint, metres, for styles that have a range of heights.
   */
  float height;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   Style to move in. Default: the current one.
   */
  const char *style;
  /*
   The only gait of the style to use. Default: those that suit the velocity.
   */
  const char *gait;
} TroupeLocomotion;

/*
 A point of a path.
 */
typedef struct TroupePathPoint {
  /*
   Place to pass, metres. Its height is ignored.
   */
  struct TroupeVec3 position;
  /*
   What to face there, radians. Not set: along the path.
   */
  float heading;
  /*
   Time of arrival, seconds from the command: increasing, and for all points or none.
   */
  float time_s;
  /*
   `TROUPE_SET_HEADING` and `TROUPE_SET_TIME`, added up.
   */
  uint32_t set;
} TroupePathPoint;

/*
 A path to follow. The character goes to the first point, which is at most 5 m away, and stands
 at the last.
 */
typedef struct TroupePath {
  /*
   `sizeof(TroupePath)`.
   */
  uint32_t size;
  /*
   Number of points: 2 to 1024.
   */
  uint32_t point_count;
  /*
   `sizeof(TroupePathPoint)`.
   */
  uint32_t point_size;
  /*
   Speed for points without times, metres a second: 0.05 to 15. Zero: the style's.
   */
  float speed;
  /*
   1: go on from the last point to the first, for ever.
   */
  uint32_t is_loop;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   The way, in order: `point_count` of them.
   */
  const struct TroupePathPoint *points;
  /*
   Style to move in. Default: the current one.
   */
  const char *style;
} TroupePath;

/*
 A sentence to act out.
 */
typedef struct TroupePerformance {
  /*
   `sizeof(TroupePerformance)`.
   */
  uint32_t size;
  /*
   `TROUPE_SET_TEMPERATURE`, or zero.
   */
  uint32_t set;
  /*
   The sentence: 1 to 1000 characters.
   */
  const char *text;
  /*
   Name of the pack that acts it out. Default: the server decides.
   */
  const char *pack;
  /*
   Length, 0.5 to 30 seconds. Zero: the model decides.
   */
  float seconds;
  /*
   Temperature, 0 to 2. 0 takes the likeliest motion. Not set: the pack's.
   */
  float temperature;
} TroupePerformance;

/*
 Which pack to open. Texts that are null or empty take the defaults.
 */
typedef struct TroupePackOptions {
  /*
   `sizeof(TroupePackOptions)`.
   */
  uint32_t size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   Name of the pack. Default: the server's default pack.
   */
  const char *name;
  /*
   Name of the body, for packs with several. Default: the pack's.
   */
  const char *body;
  /*
   Name of a skeleton of your own that the server has, which characters shall wear. Default:
   none.
   */
  const char *skeleton;
} TroupePackOptions;

/*
 What there is to know of a pack. Texts and arrays hold until the pack is closed. Texts are never
 null.
 */
typedef struct TroupePackInfo {
  /*
   `sizeof(TroupePackInfo)`.
   */
  uint32_t size;
  /*
   Number of joints. Parents come before their children; frames use this order.
   */
  uint32_t joint_count;
  /*
   Names of the joints.
   */
  const char *const *joint_names;
  /*
   Index of each joint's parent; -1 for the first joint.
   */
  const int32_t *joint_parents;
  /*
   Offset of each joint from its parent in the parent's frame while no joint turns, metres:
   three numbers each. That of the first joint is not used: frames have its position.
   */
  const float *joint_offsets;
  /*
   Names of the joints that touch the ground: bit n of a frame's contacts is joint n of these.
   */
  const char *const *contact_names;
  /*
   Number of contact joints.
   */
  uint32_t contact_count;
  /*
   Number of styles. Zero for a pack without live characters.
   */
  uint32_t style_count;
  /*
   Names of the styles, sorted.
   */
  const char *const *style_names;
  /*
   Name of the style of characters that name none.
   */
  const char *default_style;
  /*
   Names of the skills.
   */
  const char *const *skill_names;
  /*
   Number of skills.
   */
  uint32_t skill_count;
  /*
   Frames a second of the networks. Crowds come at 30, 50 or 60 frames a second.
   */
  float fps;
  /*
   Name of the pack.
   */
  const char *name;
  /*
   Version of the pack.
   */
  const char *version;
  /*
   Licence of the weights.
   */
  const char *licence;
} TroupePackInfo;

/*
 The last error of a thread. Its texts are UTF-8, never null, and hold until the next call of
 this thread that fails.
 */
typedef struct TroupeError {
  /*
   `sizeof(TroupeError)`.
   */
  uint32_t size;
  /*
   Code of the error; `TROUPE_STATUS_OK` if no call of this thread has failed.
   */
  TroupeStatus status;
  /*
   What is wrong, and what to do about it.
   */
  const char *message;
  /*
   The argument or the field of the request that is at fault. Empty: none.
   */
  const char *field;
  /*
   Allowed values of the field. Empty: see the message.
   */
  const char *allowed;
  /*
   The server's word for the kind of error, such as `UNKNOWN_STYLE`. Empty: none.
   */
  const char *reason;
  /*
   Id of the request, which the server's log lines show. Empty: none.
   */
  const char *request_id;
} TroupeError;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 The `TROUPE_ABI_VERSION` of the library. Compare it with that of the header before all else.
 */
uint32_t troupe_abi_version(void);

/*
 The version of the library, such as `0.1.0`. The text holds for ever.
 */
const char *troupe_version(void);

/*
 Opens a connection. It has one thread of its own, which ends when the connection and all of its
 crowds are closed.

 # Safety
 `options` is null or points to options whose `size` is set, and whose texts end with NUL. `out`
 is null or can be written.
 */
TroupeStatus troupe_connect(const struct TroupeConnectOptions *options, struct TroupeConnection *out);

/*
 Lists the packs of the server.

 # Safety
 `out` is null, or points to a `TroupePacks` whose `size` is set.
 */
TroupeStatus troupe_packs(struct TroupeConnection connection, struct TroupePacks *out);

/*
 Closes a connection. Its packs and crowds stay open until they are closed.
 */
TroupeStatus troupe_connection_close(struct TroupeConnection connection);

/*
 Opens a crowd of a pack, all characters or none. On the server's clock it begins to move at
 once.

 # Safety
 `options` is null or points to options whose `size` is set, with an array of characters as large
 as they say, and texts that end with NUL. `out` is null or can be written.
 */
TroupeStatus troupe_crowd_open(struct TroupePack pack,
                               const struct TroupeCrowdOptions *options,
                               struct TroupeCrowd *out);

/*
 Reads the newest frames of a crowd on the server's clock. Waits for them at most `timeout_ms`.

 `TROUPE_STATUS_OK`: they are newer than those of the last read. `TROUPE_STATUS_EMPTY`: they are
 not, and `out` has the last ones again; before the first, no character is present. After an
 error that ends the crowd, each read returns it. This allocates no memory.

 On the caller's clock it gives the frames of the last step again, and returns
 `TROUPE_STATUS_EMPTY`.

 # Safety
 `out` is null, or points to a `TroupeFrames` whose `size` is set.
 */
TroupeStatus troupe_crowd_read(struct TroupeCrowd crowd, uint32_t timeout_ms, struct TroupeFrames *out);

/*
 Advances a crowd on the caller's clock by 1 to 120 frames, and reads them. Commands go with it.

 A step that fails because the connection broke may be tried again: the characters wait on the
 server until their time to live is over, and then go on.

 # Safety
 `out` is null, or points to a `TroupeFrames` whose `size` is set.
 */
TroupeStatus troupe_crowd_step(struct TroupeCrowd crowd, uint32_t frames, struct TroupeFrames *out);

/*
 Takes the oldest note of a crowd. `TROUPE_STATUS_EMPTY`: none waits, and `out` stays as it is.

 # Safety
 `out` is null, or points to a `TroupeNote` whose `size` is set.
 */
TroupeStatus troupe_crowd_note(struct TroupeCrowd crowd, struct TroupeNote *out);

/*
 Closes a crowd, and its characters on the server. Its frames and notes are invalid from now on.
 If the server cannot be reached the handle is closed all the same, the error says so, and the
 characters expire.
 */
TroupeStatus troupe_crowd_close(struct TroupeCrowd crowd);

/*
 Has a character move over the ground. This ends what it does otherwise. It may be called as
 often as you like: of several the newest counts, and only changes go to the server.

 # Safety
 `locomotion` is null, or points to one whose `size` is set, and whose texts end with NUL.
 */
TroupeStatus troupe_crowd_move(struct TroupeCrowd crowd,
                               uint32_t character,
                               const struct TroupeLocomotion *locomotion);

/*
 Has a character stand, in the current style.
 */
TroupeStatus troupe_crowd_stand(struct TroupeCrowd crowd, uint32_t character);

/*
 Has a character follow a path. A note (`TROUPE_NOTE_KIND_ARRIVED`) says when it is at the end.

 # Safety
 `path` is null, or points to one whose `size` is set, with as many points as it says, and texts
 that end with NUL.
 */
TroupeStatus troupe_crowd_follow_path(struct TroupeCrowd crowd,
                                      uint32_t character,
                                      const struct TroupePath *path);

/*
 Has a character go straight to a place, metres, and stand there. It sets out from where the last
 frame that came shows it. `speed` is in metres a second; zero: the style's. A note
 (`TROUPE_NOTE_KIND_ARRIVED`) says when it is there.

 # Safety
 `style` is null, or ends with NUL.
 */
TroupeStatus troupe_crowd_go_to(struct TroupeCrowd crowd,
                                uint32_t character,
                                struct TroupeVec3 position,
                                float speed,
                                const char *style);

/*
 Has a character go to an object of its scene and use it. `variant` and `approach` may be null:
 then the seed decides, and the nearest approach is taken. Do not move the character until it is
 over, because that ends it.

 # Safety
 The texts are null, or end with NUL.
 */
TroupeStatus troupe_crowd_interact(struct TroupeCrowd crowd,
                                   uint32_t character,
                                   const char *object,
                                   const char *variant,
                                   const char *approach);

/*
 Has a character do a skill of its pack where it stands. `variant` may be null: then the seed
 decides.

 # Safety
 The texts are null, or end with NUL.
 */
TroupeStatus troupe_crowd_skill(struct TroupeCrowd crowd,
                                uint32_t character,
                                const char *name,
                                const char *variant);

/*
 Has a character act out a sentence, and go on as before.

 # Safety
 `performance` is null, or points to one whose `size` is set, and whose texts end with NUL.
 */
TroupeStatus troupe_crowd_perform(struct TroupeCrowd crowd,
                                  uint32_t character,
                                  const struct TroupePerformance *performance);

/*
 Has a character leave what it holds, such as a seat, by its exit.
 */
TroupeStatus troupe_crowd_end_interaction(struct TroupeCrowd crowd, uint32_t character);

/*
 Has a character stop everything at once, drop the object in its hand, and stand.
 */
TroupeStatus troupe_crowd_cancel(struct TroupeCrowd crowd, uint32_t character);

/*
 Has a character put down the object in its hand.
 */
TroupeStatus troupe_crowd_drop(struct TroupeCrowd crowd, uint32_t character);

/*
 Sets how much a character matters if there are more than the server can serve, 0 to 1: 0 is far
 from the camera, 1 the hero, 0.5 the default. Every change is a command, so use steps of a
 tenth.
 */
TroupeStatus troupe_crowd_set_priority(struct TroupeCrowd crowd, uint32_t character, float priority);

/*
 Opens a pack.

 # Safety
 `options` is null or points to options whose `size` is set, and whose texts end with NUL. `out`
 is null or can be written.
 */
TroupeStatus troupe_pack_open(struct TroupeConnection connection,
                              const struct TroupePackOptions *options,
                              struct TroupePack *out);

/*
 What there is to know of a pack. It asks no server, and may be called from any thread.

 # Safety
 `out` is null, or points to a `TroupePackInfo` whose `size` is set.
 */
TroupeStatus troupe_pack_info(struct TroupePack pack, struct TroupePackInfo *out);

/*
 Closes a pack. Its crowds stay open until they are closed.
 */
TroupeStatus troupe_pack_close(struct TroupePack pack);

/*
 What failed last on this thread. The texts are never null.

 It fails itself if `out` is null, or if its size is unknown; then it returns
 `TROUPE_STATUS_ARGUMENT`, and the last error stays as it was.

 # Safety
 `out` is null, or points to a `TroupeError` whose `size` is set.
 */
TroupeStatus troupe_last_error(struct TroupeError *out);

/*
 What failed last on this thread. The texts are never null.

 It fails itself if `out` is null, or if its size is unknown; then it returns
 `TROUPE_STATUS_ARGUMENT`, and the last error stays as it was.

 # Safety
 `out` is null, or points to a `TroupeError` whose `size` is set.
 */
TroupeStatus troupe_last_error(struct TroupeError *out);

/*
 Opens a connection. It has one thread of its own, which ends when the connection and all of its
 crowds are closed.

 # Safety
 `options` is null or points to options whose `size` is set, and whose texts end with NUL. `out`
 is null or can be written.
 */
TroupeStatus troupe_connect(const struct TroupeConnectOptions *options, struct TroupeConnection *out);

/*
 Lists the packs of the server.

 # Safety
 `out` is null, or points to a `TroupePacks` whose `size` is set.
 */
TroupeStatus troupe_packs(struct TroupeConnection connection, struct TroupePacks *out);

/*
 Closes a connection. Its packs and crowds stay open until they are closed.
 */
TroupeStatus troupe_connection_close(struct TroupeConnection connection);

/*
 Opens a pack.

 # Safety
 `options` is null or points to options whose `size` is set, and whose texts end with NUL. `out`
 is null or can be written.
 */
TroupeStatus troupe_pack_open(struct TroupeConnection connection,
                              const struct TroupePackOptions *options,
                              struct TroupePack *out);

/*
 What there is to know of a pack. It asks no server, and may be called from any thread.

 # Safety
 `out` is null, or points to a `TroupePackInfo` whose `size` is set.
 */
TroupeStatus troupe_pack_info(struct TroupePack pack, struct TroupePackInfo *out);

/*
 Closes a pack. Its crowds stay open until they are closed.
 */
TroupeStatus troupe_pack_close(struct TroupePack pack);

/*
 Opens a crowd of a pack, all characters or none. On the server's clock it begins to move at
 once.

 # Safety
 `options` is null or points to options whose `size` is set, with an array of characters as large
 as they say, and texts that end with NUL. `out` is null or can be written.
 */
TroupeStatus troupe_crowd_open(struct TroupePack pack,
                               const struct TroupeCrowdOptions *options,
                               struct TroupeCrowd *out);

/*
 Reads the newest frames of a crowd on the server's clock. Waits for them at most `timeout_ms`.

 `TROUPE_STATUS_OK`: they are newer than those of the last read. `TROUPE_STATUS_EMPTY`: they are
 not, and `out` has the last ones again; before the first, no character is present. After an
 error that ends the crowd, each read returns it. This allocates no memory.

 On the caller's clock it gives the frames of the last step again, and returns
 `TROUPE_STATUS_EMPTY`.

 # Safety
 `out` is null, or points to a `TroupeFrames` whose `size` is set.
 */
TroupeStatus troupe_crowd_read(struct TroupeCrowd crowd, uint32_t timeout_ms, struct TroupeFrames *out);

/*
 Advances a crowd on the caller's clock by 1 to 120 frames, and reads them. Commands go with it.

 A step that fails because the connection broke may be tried again: the characters wait on the
 server until their time to live is over, and then go on.

 # Safety
 `out` is null, or points to a `TroupeFrames` whose `size` is set.
 */
TroupeStatus troupe_crowd_step(struct TroupeCrowd crowd, uint32_t frames, struct TroupeFrames *out);

/*
 Takes the oldest note of a crowd. `TROUPE_STATUS_EMPTY`: none waits, and `out` stays as it is.

 # Safety
 `out` is null, or points to a `TroupeNote` whose `size` is set.
 */
TroupeStatus troupe_crowd_note(struct TroupeCrowd crowd, struct TroupeNote *out);

/*
 Closes a crowd, and its characters on the server. Its frames and notes are invalid from now on.
 If the server cannot be reached the handle is closed all the same, the error says so, and the
 characters expire.
 */
TroupeStatus troupe_crowd_close(struct TroupeCrowd crowd);

/*
 Has a character move over the ground. This ends what it does otherwise. It may be called as
 often as you like: of several the newest counts, and only changes go to the server.

 # Safety
 `locomotion` is null, or points to one whose `size` is set, and whose texts end with NUL.
 */
TroupeStatus troupe_crowd_move(struct TroupeCrowd crowd,
                               uint32_t character,
                               const struct TroupeLocomotion *locomotion);

/*
 Has a character stand, in the current style.
 */
TroupeStatus troupe_crowd_stand(struct TroupeCrowd crowd, uint32_t character);

/*
 Has a character follow a path. A note (`TROUPE_NOTE_KIND_ARRIVED`) says when it is at the end.

 # Safety
 `path` is null, or points to one whose `size` is set, with as many points as it says, and texts
 that end with NUL.
 */
TroupeStatus troupe_crowd_follow_path(struct TroupeCrowd crowd,
                                      uint32_t character,
                                      const struct TroupePath *path);

/*
 Has a character go straight to a place, metres, and stand there. It sets out from where the last
 frame that came shows it. `speed` is in metres a second; zero: the style's. A note
 (`TROUPE_NOTE_KIND_ARRIVED`) says when it is there.

 # Safety
 `style` is null, or ends with NUL.
 */
TroupeStatus troupe_crowd_go_to(struct TroupeCrowd crowd,
                                uint32_t character,
                                struct TroupeVec3 position,
                                float speed,
                                const char *style);

/*
 Has a character go to an object of its scene and use it. `variant` and `approach` may be null:
 then the seed decides, and the nearest approach is taken. Do not move the character until it is
 over, because that ends it.

 # Safety
 The texts are null, or end with NUL.
 */
TroupeStatus troupe_crowd_interact(struct TroupeCrowd crowd,
                                   uint32_t character,
                                   const char *object,
                                   const char *variant,
                                   const char *approach);

/*
 Has a character do a skill of its pack where it stands. `variant` may be null: then the seed
 decides.

 # Safety
 The texts are null, or end with NUL.
 */
TroupeStatus troupe_crowd_skill(struct TroupeCrowd crowd,
                                uint32_t character,
                                const char *name,
                                const char *variant);

/*
 Has a character act out a sentence, and go on as before.

 # Safety
 `performance` is null, or points to one whose `size` is set, and whose texts end with NUL.
 */
TroupeStatus troupe_crowd_perform(struct TroupeCrowd crowd,
                                  uint32_t character,
                                  const struct TroupePerformance *performance);

/*
 Has a character leave what it holds, such as a seat, by its exit.
 */
TroupeStatus troupe_crowd_end_interaction(struct TroupeCrowd crowd, uint32_t character);

/*
 Has a character stop everything at once, drop the object in its hand, and stand.
 */
TroupeStatus troupe_crowd_cancel(struct TroupeCrowd crowd, uint32_t character);

/*
 Has a character put down the object in its hand.
 */
TroupeStatus troupe_crowd_drop(struct TroupeCrowd crowd, uint32_t character);

/*
 Sets how much a character matters if there are more than the server can serve, 0 to 1: 0 is far
 from the camera, 1 the hero, 0.5 the default. Every change is a command, so use steps of a
 tenth.
 */
TroupeStatus troupe_crowd_set_priority(struct TroupeCrowd crowd, uint32_t character, float priority);

/*
 Has a character move over the ground. This ends what it does otherwise. It may be called as
 often as you like: of several the newest counts, and only changes go to the server.

 # Safety
 `locomotion` is null, or points to one whose `size` is set, and whose texts end with NUL.
 */
TroupeStatus troupe_crowd_move(struct TroupeCrowd crowd,
                               uint32_t character,
                               const struct TroupeLocomotion *locomotion);

/*
 Has a character stand, in the current style.
 */
TroupeStatus troupe_crowd_stand(struct TroupeCrowd crowd, uint32_t character);

/*
 Has a character follow a path. A note (`TROUPE_NOTE_KIND_ARRIVED`) says when it is at the end.

 # Safety
 `path` is null, or points to one whose `size` is set, with as many points as it says, and texts
 that end with NUL.
 */
TroupeStatus troupe_crowd_follow_path(struct TroupeCrowd crowd,
                                      uint32_t character,
                                      const struct TroupePath *path);

/*
 Has a character go straight to a place, metres, and stand there. It sets out from where the last
 frame that came shows it. `speed` is in metres a second; zero: the style's. A note
 (`TROUPE_NOTE_KIND_ARRIVED`) says when it is there.

 # Safety
 `style` is null, or ends with NUL.
 */
TroupeStatus troupe_crowd_go_to(struct TroupeCrowd crowd,
                                uint32_t character,
                                struct TroupeVec3 position,
                                float speed,
                                const char *style);

/*
 Has a character go to an object of its scene and use it. `variant` and `approach` may be null:
 then the seed decides, and the nearest approach is taken. Do not move the character until it is
 over, because that ends it.

 # Safety
 The texts are null, or end with NUL.
 */
TroupeStatus troupe_crowd_interact(struct TroupeCrowd crowd,
                                   uint32_t character,
                                   const char *object,
                                   const char *variant,
                                   const char *approach);

/*
 Has a character do a skill of its pack where it stands. `variant` may be null: then the seed
 decides.

 # Safety
 The texts are null, or end with NUL.
 */
TroupeStatus troupe_crowd_skill(struct TroupeCrowd crowd,
                                uint32_t character,
                                const char *name,
                                const char *variant);

/*
 Has a character act out a sentence, and go on as before.

 # Safety
 `performance` is null, or points to one whose `size` is set, and whose texts end with NUL.
 */
TroupeStatus troupe_crowd_perform(struct TroupeCrowd crowd,
                                  uint32_t character,
                                  const struct TroupePerformance *performance);

/*
 Has a character leave what it holds, such as a seat, by its exit.
 */
TroupeStatus troupe_crowd_end_interaction(struct TroupeCrowd crowd, uint32_t character);

/*
 Has a character stop everything at once, drop the object in its hand, and stand.
 */
TroupeStatus troupe_crowd_cancel(struct TroupeCrowd crowd, uint32_t character);

/*
 Has a character put down the object in its hand.
 */
TroupeStatus troupe_crowd_drop(struct TroupeCrowd crowd, uint32_t character);

/*
 Sets how much a character matters if there are more than the server can serve, 0 to 1: 0 is far
 from the camera, 1 the hero, 0.5 the default. Every change is a command, so use steps of a
 tenth.
 */
TroupeStatus troupe_crowd_set_priority(struct TroupeCrowd crowd, uint32_t character, float priority);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* TROUPE_H */
