import { describe, expect, it } from 'vitest';
import type { DecodedBlock } from '../wire/codec';
import { PlaybackClock, RATE_HZ, slerp, Track } from './playback';

function block(x: number, angle: number, frame: number): DecodedBlock {
  return {
    body: 'human',
    joints: 1,
    slots: Uint32Array.of(0),
    frames: Float64Array.of(frame),
    roots: Float32Array.of(x, 1, 0),
    rotations: Float32Array.of(0, Math.sin(angle / 2), 0, Math.cos(angle / 2)),
    contacts: Uint8Array.of(frame % 2),
  };
}

describe('track', () => {
  it('interpolates between frames and stays at the last one', () => {
    const track = new Track();
    track.push(0, block(0, 0, 1), 0);
    track.push(1, block(2, 1, 2), 0);
    const root = new Float32Array(3);
    const rotations = new Float32Array(4);
    expect(track.sample(0.25, root, rotations)).toBe(1);
    expect(root[0]).toBeCloseTo(0.5);
    expect(2 * Math.asin(rotations[1]!)).toBeCloseTo(0.25, 5);
    track.sample(9, root, rotations);
    expect(root[0]).toBeCloseTo(2);
    expect(track.frame).toBe(2);
  });

  it('ignores frames that are not newer', () => {
    const track = new Track();
    track.push(1, block(0, 0, 1), 0);
    track.push(1, block(5, 0, 1), 0);
    expect(track.newest(4)).toHaveLength(1);
  });
});

it('slerp goes the short way and keeps unit length', () => {
  const a = Float32Array.of(0, 0, 0, 1);
  const b = Float32Array.of(0, -Math.sin(0.5), 0, -Math.cos(0.5));
  const out = new Float32Array(4);
  slerp(a, 0, b, 0, 0.5, out, 0);
  expect(Math.hypot(...out)).toBeCloseTo(1, 6);
  expect(2 * Math.asin(Math.abs(out[1]!))).toBeCloseTo(0.5, 5);
});

describe('clock', () => {
  it('stays about two ticks behind frames that come at their rate', () => {
    const clock = new PlaybackClock();
    let jumps = 0;
    let before = clock.now;
    for (let i = 1; i <= 600; i++) {
      if (i % 2 === 0) clock.push(i / 2 / RATE_HZ);
      clock.advance(1 / 60);
      if (clock.now < before) jumps++;
      before = clock.now;
    }
    expect(jumps).toBe(0);
    expect(clock.newest - clock.now).toBeGreaterThan(0.5 / RATE_HZ);
    expect(clock.newest - clock.now).toBeLessThan(4 / RATE_HZ);
  });

  it('jumps to frames that are far ahead', () => {
    const clock = new PlaybackClock();
    clock.push(10);
    clock.advance(1 / 60);
    expect(clock.newest - clock.now).toBeLessThan(0.1);
  });

  it('comes to the newest frame when it stands', () => {
    const clock = new PlaybackClock();
    clock.push(0.1);
    clock.speed = 0;
    for (let i = 0; i < 60; i++) clock.advance(1 / 60);
    expect(clock.now).toBeCloseTo(0.1);
  });
});
