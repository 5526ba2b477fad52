/* tslint:disable */
/* eslint-disable */
export const memory: WebAssembly.Memory;
export const __wbg_read_free: (a: number, b: number) => void;
export const animations: (a: number, b: number) => [number, number, number, number];
export const options: () => [number, number, number, number];
export const read: (a: number, b: number, c: number, d: number, e: number, f: number) => [number, number, number];
export const read_fps: (a: number) => number;
export const read_frames: (a: number) => number;
export const read_names: (a: number) => [number, number];
export const read_offsets: (a: number) => [number, number];
export const read_parents: (a: number) => [number, number];
export const read_roots: (a: number) => [number, number];
export const read_rotations: (a: number) => [number, number];
export const read_table: (a: number) => [number, number, number, number];
export const __wbindgen_exn_store: (a: number) => void;
export const __externref_table_alloc: () => number;
export const __wbindgen_externrefs: WebAssembly.Table;
export const __wbindgen_malloc: (a: number, b: number) => number;
export const __wbindgen_free: (a: number, b: number, c: number) => void;
export const __externref_table_dealloc: (a: number) => void;
export const __externref_drop_slice: (a: number, b: number) => void;
export const __wbindgen_realloc: (a: number, b: number, c: number, d: number) => number;
export const __wbindgen_start: () => void;
