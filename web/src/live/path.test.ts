import { describe, expect, it } from 'vitest';
import type { Place } from './path';
import { distance, pathFrom, simplify, spread } from './path';

const circle = Array.from({ length: 400 }, (_, i): Place => [3 * Math.cos(i / 60), 3 * Math.sin(i / 60)]);

describe('simplify', () => {
  it('keeps the ends of a straight line alone', () => {
    const line = Array.from({ length: 50 }, (_, i): Place => [i * 0.1, i * 0.2]);
    expect(simplify(line, 0.01)).toEqual([line[0], line[49]]);
  });

  it('stays within its tolerance', () => {
    const few = simplify(circle, 0.05);
    expect(few.length).toBeLessThan(60);
    for (const place of circle) {
      const nearest = Math.min(...few.map((other) => distance(place, other)));
      expect(nearest).toBeLessThan(1);
    }
  });
});

it('spread leaves out near places and keeps the last', () => {
  const places: Place[] = [
    [0, 0],
    [0.1, 0],
    [1, 0],
    [1.05, 0],
  ];
  expect(spread(places, 0.3)).toEqual([
    [0, 0],
    [1.05, 0],
  ]);
});

describe('pathFrom', () => {
  it('begins at the character where the line begins far away', () => {
    const path = pathFrom(
      [
        [10, 0],
        [12, 0],
      ],
      [0, 0],
    );
    expect(path?.map((point) => point.position.x)).toEqual([0, 10, 12]);
  });

  it('begins with the line if that is near', () => {
    const path = pathFrom(circle, [2, 0]);
    expect(path?.[0]?.position).toEqual({ x: 3, y: 0, z: 0 });
  });

  it('has at most as many points as the server takes', () => {
    const noisy = Array.from({ length: 1500 }, (_, i): Place => [i * 0.3, (i % 2) * 2]);
    expect(pathFrom(noisy, [0, 0])!.length).toBeLessThanOrEqual(1024);
  });

  it('is none for a single place', () => {
    expect(pathFrom([[1, 1]], [0, 0])).toBeUndefined();
  });
});
