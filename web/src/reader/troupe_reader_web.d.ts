/* tslint:disable */
/* eslint-disable */

/**
 * A file that was read.
 */
export class Read {
    private constructor();
    free(): void;
    [Symbol.dispose](): void;
    /**
     * Frames a second.
     */
    readonly fps: number;
    /**
     * Number of frames, at least 1.
     */
    readonly frames: number;
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
 * Names of a glTF file's animations.
 *
 * # Errors
 * If the file is not glTF.
 */
export function animations(bytes: Uint8Array | number[]): string[];

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
 * that fit.
 */
export function read(name: string, bytes: Uint8Array | number[], options: string): Read;

export type InitInput = RequestInfo | URL | Response | BufferSource | WebAssembly.Module;

export interface InitOutput {
    readonly memory: WebAssembly.Memory;
    readonly __wbg_read_free: (a: number, b: number) => void;
    readonly animations: (a: number, b: number) => [number, number, number, number];
    readonly options: () => [number, number, number, number];
    readonly read: (a: number, b: number, c: number, d: number, e: number, f: number) => [number, number, number];
    readonly read_fps: (a: number) => number;
    readonly read_frames: (a: number) => number;
    readonly read_names: (a: number) => [number, number];
    readonly read_offsets: (a: number) => [number, number];
    readonly read_parents: (a: number) => [number, number];
    readonly read_roots: (a: number) => [number, number];
    readonly read_rotations: (a: number) => [number, number];
    readonly read_table: (a: number) => [number, number, number, number];
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
