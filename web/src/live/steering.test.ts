import { describe, expect, it } from 'vitest';
import { places, radiusFor, Wanderer } from './steering';

describe('wanderers', () => {
  it('stay within their circle', () => {
    const radius = radiusFor(24);
    const wanderers = places(24, 3).map((place, i) => ({ ...place, wanderer: new Wanderer(i, place.heading) }));
    let farthest = 0;
    for (let step = 0; step < 200; step++) {
      for (const one of wanderers) {
        const go = one.wanderer.decide(one, [], radius, 1.3);
        one.x += (go?.x ?? 0) * 1.5;
        one.z += (go?.z ?? 0) * 1.5;
        farthest = Math.max(farthest, Math.hypot(one.x, one.z));
      }
    }
    expect(farthest).toBeLessThan(radius * 1.3);
  });

  it('turn away from somebody close', () => {
    let away = 0;
    for (let seed = 0; seed < 50; seed++) {
      const go = new Wanderer(seed, 0).decide({ x: 0, z: 0 }, [{ x: 0, z: 0.3 }], 20, 1);
      if (go && go.z < 0) away++;
    }
    expect(away).toBeGreaterThan(20);
  });

  it('do the same for the same seed', () => {
    const once = new Wanderer(5, 1).decide({ x: 1, z: 1 }, [], 9, 1.2);
    expect(new Wanderer(5, 1).decide({ x: 1, z: 1 }, [], 9, 1.2)).toEqual(once);
  });
});

it('a crowd begins apart from each other', () => {
  const all = places(200, 1);
  const nearest = all.map((a, i) =>
    Math.min(...all.filter((_, j) => j !== i).map((b) => Math.hypot(a.x - b.x, a.z - b.z))),
  );
  expect(Math.min(...nearest)).toBeGreaterThan(0.7);
});
