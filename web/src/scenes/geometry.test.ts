import { describe, expect, it } from 'vitest';
import { geometryOf, shapeOf } from './geometry';

describe('geometryOf', () => {
  it('puts a box about its middle', () => {
    const shape = shapeOf({ box: { center: { x: 0, y: 1, z: 0 }, half_extents: { x: 1, y: 0.5, z: 2 } } });
    const geometry = geometryOf(shape!);
    geometry.computeBoundingBox();
    expect(geometry.boundingBox?.min.toArray()).toEqual([-1, 0.5, -2]);
    expect(geometry.boundingBox?.max.toArray()).toEqual([1, 1.5, 2]);
  });

  it('makes the hull of points', () => {
    const corners = [0, 1].flatMap((x) => [0, 1].flatMap((y) => [0, 1].map((z) => ({ x, y, z }))));
    const geometry = geometryOf(shapeOf({ convex: { points: [...corners, { x: 0.5, y: 0.5, z: 0.5 }] } })!);
    geometry.computeBoundingBox();
    expect(geometry.boundingBox?.max.toArray()).toEqual([1, 1, 1]);
    // Six faces of two triangles, three corners each.
    expect(geometry.getAttribute('position').count).toBe(36);
  });

  it('lays heights from back to front and from right to left, facing up', () => {
    const heightfield = { rows: 2, columns: 3, width: 4, depth: 2, heights: [0, 1, 2, 3, 4, 5] };
    const geometry = geometryOf(shapeOf({ heightfield })!);
    const place = geometry.getAttribute('position');
    expect([place.getX(0), place.getY(0), place.getZ(0)]).toEqual([-2, 0, -1]);
    expect([place.getX(5), place.getY(5), place.getZ(5)]).toEqual([2, 5, 1]);
    const up = geometry.getAttribute('normal');
    for (let i = 0; i < up.count; i++) expect(up.getY(i)).toBeGreaterThan(0);
  });

  it('knows no shape of an empty collider', () => {
    expect(shapeOf({})).toBeUndefined();
  });
});
