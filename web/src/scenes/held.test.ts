import { describe, expect, it } from 'vitest';
import { HeldTrack } from './held';

describe('HeldTrack', () => {
  const position = new Float32Array(3);
  const rotation = new Float32Array(4);
  const made = () => {
    const track = new HeldTrack();
    track.push(1, [0, 1, 0], [0, 0, 0, 1]);
    track.push(2, [2, 1, 0], [0, 1, 0, 0]);
    return track;
  };

  it('has nothing in the hand before it was taken', () => {
    expect(made().sample(0.9, position, rotation)).toBe(false);
    expect(new HeldTrack().sample(1, position, rotation)).toBe(false);
  });

  it('is between two samples at a time between them', () => {
    expect(made().sample(1.5, position, rotation)).toBe(true);
    expect([...position]).toEqual([1, 1, 0]);
    expect(rotation[1]).toBeCloseTo(Math.SQRT1_2);
    expect(rotation[3]).toBeCloseTo(Math.SQRT1_2);
  });

  it('stays at the newest', () => {
    expect(made().sample(7, position, rotation)).toBe(true);
    expect([...position]).toEqual([2, 1, 0]);
    expect(made().newest).toBe(2);
  });

  it('forgets the oldest', () => {
    const track = new HeldTrack();
    for (let i = 0; i < 40; i++) track.push(i, [i, 0, 0], [0, 0, 0, 1]);
    expect(track.sample(3, position, rotation)).toBe(false);
    expect(track.sample(30, position, rotation)).toBe(true);
    expect(position[0]).toBe(30);
  });
});
