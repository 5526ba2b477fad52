/* tslint:disable */
/* eslint-disable */
export const memory: WebAssembly.Memory;
export const __wbg_read_free: (a: number, b: number) => void;
export const animations: (a: number, b: number, c: number) => void;
export const read: (a: number, b: number, c: number, d: number, e: number, f: number, g: number) => void;
export const read_fps: (a: number) => number;
export const read_frames: (a: number) => number;
export const read_names: (a: number, b: number) => void;
export const read_offsets: (a: number, b: number) => void;
export const read_parents: (a: number, b: number) => void;
export const read_roots: (a: number, b: number) => void;
export const read_rotations: (a: number, b: number) => void;
export const read_table: (a: number, b: number) => void;
export const __wbindgen_externrefs: WebAssembly.Table;
export const __wbindgen_add_to_stack_pointer: (a: number) => number;
export const __wbindgen_export: (a: number, b: number) => number;
export const __wbindgen_export2: (a: number, b: number, c: number) => void;
export const __wbindgen_export3: (a: number) => void;
export const __wbindgen_export4: (a: number, b: number) => void;
export const __wbindgen_export5: (a: number, b: number, c: number, d: number) => number;
export const __wbindgen_start: () => void;
