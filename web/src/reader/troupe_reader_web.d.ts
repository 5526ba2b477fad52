/* tslint:disable */
/* eslint-disable */

/**
 * A body that motion is carried from or to.
 */
export class Body {
    private constructor();
    free(): void;
    [Symbol.dispose](): void;
    /**
     * The character's file (.glb, .vrm) with a motion on its skeleton as one animation more.
     *
     * # Errors
     * If the motion does not fit the skeleton, or if the file cannot take it, with the joint.
     */
    dress(file: Uint8Array | number[], name: string, fps: number, roots: Float32Array | number[], rotations: Float32Array | number[]): Uint8Array;
    /**
     * The parts that were found, as TOML. A corrected text goes to [`Read::body`].
     *
     * # Errors
     * None that is known: parts are names.
     */
    parts(): string;
}

/**
 * A motion on the target's joints.
 */
export class Carried {
    private constructor();
    free(): void;
    [Symbol.dispose](): void;
    /**
     * 3 a frame: world places of joint 0, metres in the target's size.
     */
    readonly roots: Float32Array;
    /**
     * 4 a joint and frame: joint 0 in the world, others relative to their parents.
     */
    readonly rotations: Float32Array;
}

/**
 * Retargeters of many characters, each with its own state. Poses go in and out through memory that
 * JavaScript sees: it writes the poses and marks the members that have a new one, and [`pose`]
 * carries those over. Nothing is allocated for a frame.
 *
 * [`pose`]: Crowd::pose
 */
export class Crowd {
    private constructor();
    free(): void;
    [Symbol.dispose](): void;
    /**
     * Address of the marks: a byte a member, 1 if it has a new pose.
     */
    due(): number;
    /**
     * Makes room for `count` members. Addresses change.
     */
    grow(count: number): void;
    /**
     * Address of the target's roots: 3 floats a member.
     */
    own_roots(): number;
    /**
     * Address of the target's rotations: 4 floats a joint and member.
     */
    own_rotations(): number;
    /**
     * Carries over the poses of the members that are marked, and takes the marks away. `passed_s`
     * is the time since the last call, seconds. It also counts for members without a new pose.
     */
    pose(passed_s: number): void;
    /**
     * Lets a member begin a motion.
     */
    reset(member: number): void;
    /**
     * Address of the source's roots: 3 floats a member.
     */
    roots(): number;
    /**
     * Address of the source's rotations: 4 floats a joint and member.
     */
    rotations(): number;
}

/**
 * A file that was read.
 */
export class Read {
    private constructor();
    free(): void;
    [Symbol.dispose](): void;
    /**
     * The body of the file. `parts` (TOML) corrects what is found of it; it may be empty.
     *
     * # Errors
     * If no body is found or if it does not stand, with the joint or the angle; or if `parts` is
     * wrong, with the line.
     */
    body(parts: string): Body;
    /**
     * Frames a second.
     */
    readonly fps: number;
    /**
     * Number of frames, at least 1.
     */
    readonly frames: number;
    /**
     * The body's left in joint 0's own frame of reference, unit length.
     */
    readonly left_axis: Float32Array;
    /**
     * Names of the joints.
     */
    readonly names: string[];
    /**
     * 3 a joint: places in the parents at rest, metres.
     */
    readonly offsets: Float32Array;
    /**
     * Index of each joint's parent, -1 for the root.
     */
    readonly parents: Int16Array;
    /**
     * 3 a frame: world places of joint 0, metres.
     */
    readonly roots: Float32Array;
    /**
     * 4 a joint a frame: joint 0 in the world, others relative to their parents.
     */
    readonly rotations: Float32Array;
    /**
     * What was understood, as JSON: rows of what, its value, and one line of evidence.
     *
     * # Errors
     * None that is known: rows are text.
     */
    readonly table: string;
}

/**
 * Carries motion of one body over to another.
 */
export class Retargeter {
    free(): void;
    [Symbol.dispose](): void;
    /**
     * A motion of the source on the target, from its first frame on, with `fps` frames a second.
     *
     * # Errors
     * If `fps` is not above 0, or if the numbers are not whole frames of the source's joints.
     */
    carry(fps: number, roots: Float32Array | number[], rotations: Float32Array | number[]): Carried;
    /**
     * What is kept of built-in motions, as JSON: `trials`, each with its name and figures, and
     * `faults`, which are sentences. Without faults motion may be carried over.
     *
     * # Errors
     * None that is known: figures are numbers.
     */
    certificate(): string;
    /**
     * A crowd without members that carries poses as this one does.
     */
    crowd(): Crowd;
    /**
     * A retargeter from one body to another.
     *
     * # Errors
     * If only one of the bodies stands on four legs.
     */
    constructor(source: Body, target: Body);
    /**
     * Length of the target's legs by that of the source's.
     */
    readonly scale: number;
}

/**
 * Names of a glTF file's animations.
 *
 * # Errors
 * If the file is not glTF.
 */
export function animations(bytes: Uint8Array | number[]): string[];

/**
 * The body of a pack. `tables` (JSON) has those of its manifest: `skeleton` and, of robots,
 * `robot`. A robot's body needs no motion. Others show theirs by a motion that begins standing:
 * `roots` has 3 numbers a frame, `rotations` 4 a joint and frame.
 *
 * # Errors
 * If the tables or the motion are wrong, if no body is found, or if it does not stand.
 */
export function body_of_pack(tables: string, fps: number, roots: Float32Array | number[], rotations: Float32Array | number[]): Body;

/**
 * Reads a character's file: its joints at rest, as one frame, if it is glTF with a skin. Other
 * files are read with their motion.
 *
 * # Errors
 * As [`read`].
 */
export function character(name: string, bytes: Uint8Array | number[]): Read;

/**
 * The reader's options, as JSON: their names, and what they take.
 *
 * # Errors
 * None that is known: options are text.
 */
export function options(): string;

/**
 * Reads a file on its own skeleton, or on the one that `options` (JSON) has.
 *
 * # Errors
 * An `Error` with the reader's own words, or with what is wrong with the options. If the file is
 * wrong, its property `options` is JSON: a list of the options that decide, each with the values
 * that fit. `is_other_body` is set if the file has another skeleton than the given one.
 */
export function read(name: string, bytes: Uint8Array | number[], options: string): Read;

export type InitInput = RequestInfo | URL | Response | BufferSource | WebAssembly.Module;

export interface InitOutput {
    readonly memory: WebAssembly.Memory;
    readonly __wbg_body_free: (a: number, b: number) => void;
    readonly __wbg_carried_free: (a: number, b: number) => void;
    readonly __wbg_crowd_free: (a: number, b: number) => void;
    readonly __wbg_read_free: (a: number, b: number) => void;
    readonly __wbg_retargeter_free: (a: number, b: number) => void;
    readonly animations: (a: number, b: number) => [number, number, number, number];
    readonly body_dress: (a: number, b: number, c: number, d: number, e: number, f: number, g: number, h: number, i: number, j: number) => [number, number, number, number];
    readonly body_of_pack: (a: number, b: number, c: number, d: number, e: number, f: number, g: number) => [number, number, number];
    readonly body_parts: (a: number) => [number, number, number, number];
    readonly carried_roots: (a: number) => [number, number];
    readonly carried_rotations: (a: number) => [number, number];
    readonly character: (a: number, b: number, c: number, d: number) => [number, number, number];
    readonly crowd_due: (a: number) => number;
    readonly crowd_grow: (a: number, b: number) => void;
    readonly crowd_own_roots: (a: number) => number;
    readonly crowd_own_rotations: (a: number) => number;
    readonly crowd_pose: (a: number, b: number) => void;
    readonly crowd_reset: (a: number, b: number) => void;
    readonly crowd_roots: (a: number) => number;
    readonly crowd_rotations: (a: number) => number;
    readonly options: () => [number, number, number, number];
    readonly read: (a: number, b: number, c: number, d: number, e: number, f: number) => [number, number, number];
    readonly read_body: (a: number, b: number, c: number) => [number, number, number];
    readonly read_fps: (a: number) => number;
    readonly read_frames: (a: number) => number;
    readonly read_left_axis: (a: number) => [number, number];
    readonly read_names: (a: number) => [number, number];
    readonly read_offsets: (a: number) => [number, number];
    readonly read_parents: (a: number) => [number, number];
    readonly read_roots: (a: number) => [number, number];
    readonly read_rotations: (a: number) => [number, number];
    readonly read_table: (a: number) => [number, number, number, number];
    readonly retargeter_carry: (a: number, b: number, c: number, d: number, e: number, f: number) => [number, number, number];
    readonly retargeter_certificate: (a: number) => [number, number, number, number];
    readonly retargeter_crowd: (a: number) => number;
    readonly retargeter_new: (a: number, b: number) => [number, number, number];
    readonly retargeter_scale: (a: number) => number;
    readonly __wbindgen_exn_store: (a: number) => void;
    readonly __externref_table_alloc: () => number;
    readonly __wbindgen_externrefs: WebAssembly.Table;
    readonly __wbindgen_malloc: (a: number, b: number) => number;
    readonly __wbindgen_free: (a: number, b: number, c: number) => void;
    readonly __externref_table_dealloc: (a: number) => void;
    readonly __externref_drop_slice: (a: number, b: number) => void;
    readonly __wbindgen_realloc: (a: number, b: number, c: number, d: number) => number;
    readonly __wbindgen_start: () => void;
}

export type SyncInitInput = BufferSource | WebAssembly.Module;

/**
 * Instantiates the given `module`, which can either be bytes or
 * a precompiled `WebAssembly.Module`.
 *
 * @param {{ module: SyncInitInput }} module - Passing `SyncInitInput` directly is deprecated.
 *
 * @returns {InitOutput}
 */
export function initSync(module: { module: SyncInitInput } | SyncInitInput): InitOutput;

/**
 * If `module_or_path` is {RequestInfo} or {URL}, makes a request and
 * for everything else, calls `WebAssembly.instantiate` directly.
 *
 * @param {{ module_or_path: InitInput | Promise<InitInput> }} module_or_path - Passing `InitInput` directly is deprecated.
 *
 * @returns {Promise<InitOutput>}
 */
export default function __wbg_init (module_or_path?: { module_or_path: InitInput | Promise<InitInput> } | InitInput | Promise<InitInput>): Promise<InitOutput>;
