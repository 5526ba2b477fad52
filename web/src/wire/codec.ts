// The compact form of frames, as motion/src/codec.rs writes it.

/** Bytes of a root: three little-endian 32-bit integers, tenths of a millimetre. */
export const BYTES_PER_ROOT = 12;
/** Bytes of a rotation: three little-endian 16-bit words. */
export const BYTES_PER_ROTATION = 6;

const COMPONENT = Math.SQRT2 / 0x7fff;

/** Writes the roots of `bytes` to `out`, three numbers each, metres. */
export function decodeRoots(bytes: Uint8Array, out: Float32Array): void {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  for (let i = 0; i < out.length; i++) out[i] = view.getInt32(i * 4, true) * 1e-4;
}

/**
 * Writes the rotations of `bytes` to `out`, four numbers (x, y, z, w) each.
 *
 * The top bits of the first two words, lower first, say which of (w, x, y, z) is left out. It is positive.
 */
export function decodeRotations(bytes: Uint8Array, out: Float32Array): void {
  const count = out.length / 4;
  for (let i = 0, at = 0; i < count; i++, at += BYTES_PER_ROTATION) {
    const first = bytes[at]! | (bytes[at + 1]! << 8);
    const second = bytes[at + 2]! | (bytes[at + 3]! << 8);
    const third = bytes[at + 4]! | (bytes[at + 5]! << 8);
    const a = (first & 0x7fff) * COMPONENT - Math.SQRT1_2;
    const b = (second & 0x7fff) * COMPONENT - Math.SQRT1_2;
    const c = (third & 0x7fff) * COMPONENT - Math.SQRT1_2;
    const rest = Math.sqrt(Math.max(0, 1 - a * a - b * b - c * c));
    // Of unit length for any words, also where the three alone are longer.
    const scale = 1 / Math.sqrt(a * a + b * b + c * c + rest * rest);
    const to = i * 4;
    switch ((first >> 15) | ((second >> 15) << 1)) {
      case 0:
        put(out, to, a, b, c, rest, scale);
        break;
      case 1:
        put(out, to, rest, b, c, a, scale);
        break;
      case 2:
        put(out, to, b, rest, c, a, scale);
        break;
      default:
        put(out, to, b, c, rest, a, scale);
    }
  }
}

function put(out: Float32Array, at: number, x: number, y: number, z: number, w: number, scale: number): void {
  out[at] = x * scale;
  out[at + 1] = y * scale;
  out[at + 2] = z * scale;
  out[at + 3] = w * scale;
}

/** Frames of characters of one body, decoded. C characters, one frame each, J joints. */
export interface DecodedBlock {
  /** Key of the body: see `bodyKey`. */
  body: string;
  joints: number;
  /** Places in the stream or the step, one a character. */
  slots: Uint32Array;
  /** The sessions' frame numbers, one a character. */
  frames: Float64Array;
  /** C x 3, metres. */
  roots: Float32Array;
  /** C x J x 4: (x, y, z, w). */
  rotations: Float32Array;
  /** One byte a character: bit i is set where contact joint i stands. */
  contacts: Uint8Array;
}

/** Names a body of a pack; the body is empty for packs of one skeleton. */
export function bodyKey(pack: string, body: string | undefined): string {
  return body ? `${pack}/${body}` : pack;
}

/** What both forms of a block, protobuf's and JSON's, have in common. */
export interface PackedBlock {
  pack: string;
  body: string;
  slots: ArrayLike<number>;
  frames: ArrayLike<number>;
  roots: Uint8Array;
  rotations: Uint8Array;
  contacts: Uint8Array;
}

/** Decodes a block of one frame a character. */
export function decodeBlock(block: PackedBlock): DecodedBlock {
  const count = block.slots.length;
  const rotations = new Float32Array((block.rotations.length / BYTES_PER_ROTATION) * 4);
  const roots = new Float32Array(count * 3);
  decodeRoots(block.roots, roots);
  decodeRotations(block.rotations, rotations);
  return {
    body: bodyKey(block.pack, block.body),
    joints: rotations.length / 4 / Math.max(1, count),
    slots: Uint32Array.from(block.slots),
    frames: Float64Array.from(block.frames),
    roots,
    rotations,
    contacts: Uint8Array.from(block.contacts),
  };
}

/** The bytes of base64 text. */
export function fromBase64(text: string): Uint8Array {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}
