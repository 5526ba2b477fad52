import { describe, expect, it } from 'vitest';
import { decodeBlock, decodeRoots, decodeRotations, fromBase64 } from './codec';

/** The encoder of motion/src/codec.rs, in double precision. */
function encode(q: readonly number[]): Uint8Array {
  const [x, y, z, w] = q as [number, number, number, number];
  const all = [w, x, y, z];
  const largest = all.reduce((best, v, i) => (Math.abs(v) > Math.abs(all[best]!) ? i : best), 0);
  const sign = all[largest]! < 0 ? -1 : 1;
  const words = all
    .filter((_, i) => i !== largest)
    .map((v) => Math.round(((sign * v) / Math.SQRT1_2 + 1) * 0.5 * 0x7fff));
  if (largest & 1) words[0]! |= 0x8000;
  if (largest & 2) words[1]! |= 0x8000;
  return Uint8Array.from(words.flatMap((word) => [word & 255, word >> 8]));
}

function angle(a: readonly number[], b: ArrayLike<number>): number {
  const dot = Math.abs(a.reduce((sum, v, i) => sum + v * b[i]!, 0));
  return 2 * Math.acos(Math.min(1, dot));
}

describe('rotations', () => {
  it('come back within the error that the contract names', () => {
    let state = 7;
    const random = () => (state = (state * 48271) % 2147483647) / 2147483647 - 0.5;
    for (let i = 0; i < 500; i++) {
      const raw = [random(), random(), random(), random()];
      const length = Math.hypot(...raw);
      const q = raw.map((v) => v / length);
      const out = new Float32Array(4);
      decodeRotations(encode(q), out);
      // acos of a 32-bit dot product is good to some 5e-4.
      expect(angle(q, out)).toBeLessThan(8e-4);
    }
  });

  it('decode each component that may be left out', () => {
    for (const q of [
      [1, 0, 0, 0],
      [0, 1, 0, 0],
      [0, 0, 1, 0],
      [0, 0, 0, 1],
    ]) {
      const out = new Float32Array(4);
      decodeRotations(encode(q), out);
      q.forEach((v, i) => {
        expect(out[i]).toBeCloseTo(v, 3);
      });
    }
  });

  it('are of unit length for any words', () => {
    const out = new Float32Array(4);
    decodeRotations(Uint8Array.from([255, 127, 255, 127, 255, 127]), out);
    expect(Math.hypot(...out)).toBeCloseTo(1, 5);
  });
});

it('roots are tenths of a millimetre', () => {
  const out = new Float32Array(3);
  decodeRoots(Uint8Array.from([16, 39, 0, 0, 0xff, 0xff, 0xff, 0xff, 0, 0, 0, 0]), out);
  expect(out[0]).toBeCloseTo(1, 6);
  expect(out[1]).toBeCloseTo(-1e-4, 8);
});

it('a block that the server wrote decodes to what it wrote as floats', () => {
  // The first frame of a fresh session of the default pack: root (0, 0.92265, 0), hips as below.
  const block = decodeBlock({
    pack: 'human',
    body: '',
    slots: [0],
    frames: [1],
    roots: fromBase64('AAAAAAskAAAAAAAA'),
    rotations: fromBase64('hD2PQvN+4X+3PQFD'),
    contacts: fromBase64('AA=='),
  });
  expect(block.body).toBe('human');
  expect(block.joints).toBe(2);
  expect(block.roots[1]).toBeCloseTo(0.9227, 4);
  expect(Math.hypot(...block.rotations.subarray(0, 4))).toBeCloseTo(1, 5);
  const hips = [-0.02741993, 0.028279928, 0.69552827, 0.7174182];
  expect(angle(hips, block.rotations.subarray(0, 4))).toBeLessThan(0.02);
});
