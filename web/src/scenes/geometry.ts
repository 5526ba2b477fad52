// Shapes as three.js draws them.
import { BoxGeometry, BufferGeometry, Float32BufferAttribute, Vector3 } from 'three';
import { ConvexGeometry } from 'three/examples/jsm/geometries/ConvexGeometry.js';
import type { ColliderShape, Shape } from './types';

/** The shape of a collider as the server gives it. `undefined` if it has none. */
export function shapeOf({ box, convex, heightfield }: ColliderShape): Shape | undefined {
  if (box?.half_extents) {
    const { center, half_extents: half } = box;
    return {
      kind: 'box',
      centre: [center?.x ?? 0, center?.y ?? 0, center?.z ?? 0],
      half: [half.x, half.y, half.z],
    };
  }
  if (convex) return { kind: 'convex', points: convex.points.map(({ x, y, z }) => [x, y, z]) };
  if (heightfield) return { kind: 'heights', ...heightfield };
  return undefined;
}

export function geometryOf(shape: Shape): BufferGeometry {
  switch (shape.kind) {
    case 'box':
      return new BoxGeometry(...(shape.half.map((half) => half * 2) as [number, number, number])).translate(
        ...shape.centre,
      );
    case 'convex':
      return new ConvexGeometry(shape.points.map((point) => new Vector3(...point)));
    case 'heights':
      return heightsGeometry(shape);
  }
}

/** A grid of heights: rows from -Z to +Z, each from -X to +X. */
function heightsGeometry({ rows, columns, width, depth, heights }: Shape & { kind: 'heights' }): BufferGeometry {
  const places = new Float32Array(rows * columns * 3);
  for (let row = 0, i = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++, i++) {
      places[i * 3] = width * (column / (columns - 1) - 0.5);
      places[i * 3 + 1] = heights[i] ?? 0;
      places[i * 3 + 2] = depth * (row / (rows - 1) - 0.5);
    }
  }
  const index: number[] = [];
  for (let row = 0; row + 1 < rows; row++) {
    for (let column = 0; column + 1 < columns; column++) {
      const a = row * columns + column;
      const b = a + columns;
      index.push(a, b, a + 1, a + 1, b, b + 1);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new Float32BufferAttribute(places, 3));
  geometry.setIndex(index);
  geometry.computeVertexNormals();
  return geometry;
}
