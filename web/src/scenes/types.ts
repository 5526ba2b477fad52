// Scenes and objects as the server's JSON has them, and what the page reads from definitions.
import type { components } from '../wire/gen/openapi';

type Schemas = components['schemas'];

export type Scene = Schemas['Scene'];
export type SceneSummary = Schemas['SceneSummary'];
export type SceneObject = Schemas['SceneObject'];
export type Collider = Schemas['Collider'];
export type ColliderShape = Schemas['ColliderShape'];
export type ObjectDefinition = Schemas['ObjectDefinition'];
export type ObjectResult = Schemas['ObjectResult'];
export type HeldObject = Schemas['HeldObject'];

export interface Quat {
  w: number;
  x: number;
  y: number;
  z: number;
}

/** A place in a scene: metres, and a rotation. */
export interface Placement {
  position: { x: number; y: number; z: number };
  rotation: Quat;
}

/** A shape to draw, in the frame of what it belongs to, metres. */
export type Shape =
  | { kind: 'box'; centre: [number, number, number]; half: [number, number, number] }
  | { kind: 'convex'; points: [number, number, number][] }
  | { kind: 'heights'; rows: number; columns: number; width: number; depth: number; heights: readonly number[] };

/** A side from which an object may be used. */
export interface Approach {
  name: string;
  /** First and last direction from the object's +Z about +Y, radians. */
  from: number;
  to: number;
  /** From the pivot, metres; `undefined`: from where the character is. */
  distance: number | undefined;
}

/** What the page draws of a definition. */
export interface Drawn {
  shape: Shape;
  pivot: [number, number, number];
  approaches: Approach[];
  /** Whether characters sit down on it, until they are asked to rise. */
  isSeat: boolean;
}

export function placementOf({ position, rotation }: Pick<SceneObject, 'position' | 'rotation'>): Placement {
  return { position: position ?? { x: 0, y: 0, z: 0 }, rotation: rotation ?? { w: 1, x: 0, y: 0, z: 0 } };
}

/** A state for people, such as `held`. */
export function nameOf(state: SceneObject['state']): string {
  return state.replace('OBJECT_STATE_', '').toLowerCase();
}

/** Which way a rotation faces over the ground, radians about +Y from +Z. */
export function headingOf({ w, x, y, z }: Quat): number {
  return Math.atan2(2 * (x * z + w * y), 1 - 2 * (x * x + y * y));
}

/** The rotation that faces a way, upright. */
export function upright(heading: number): Quat {
  return { w: Math.cos(heading / 2), x: 0, y: Math.sin(heading / 2), z: 0 };
}
