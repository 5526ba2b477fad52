// What a scene shows at first sight: a character that walks to a seat and sits down.
import type { Drawn, ObjectDefinition, SceneObject } from './types';
import { headingOf, placementOf } from './types';

/** The character begins this far before the seat and to its left, metres. */
const [AHEAD_M, ASIDE_M] = [3.4, 1.2];
/** The camera stands this far to the side of the seat's front, radians. */
const ASIDE_RAD = 0.6;
const [POLAR_RAD, DISTANCE_M, TARGET_HEIGHT_M] = [1.2, 7.5, 0.6];

export interface FirstSight {
  /** Id of the seat. */
  seat: string;
  /** Whether the seat is free; if not, the character only stands before it. */
  isFree: boolean;
  /** Name of the pack whose characters can sit on it. */
  pack: string;
  /** Where the character begins, metres, and which way it faces there, radians about +Y from +Z. */
  start: { x: number; z: number };
  heading: number;
  /** State of the camera that shows the seat and the way to it. */
  camera: number[];
}

/** The first free seat of a scene, else its first one, and how to show it; `undefined` for a scene without seats. */
export function firstSightOf(
  objects: readonly SceneObject[],
  drawn: ReadonlyMap<string, Drawn>,
  definitions: readonly ObjectDefinition[],
): FirstSight | undefined {
  const seats = objects.filter(({ definition }) => drawn.get(definition)?.isSeat);
  const seat = seats.find(({ state }) => state === 'OBJECT_STATE_FREE') ?? seats[0];
  const pack = definitions.find(({ name }) => name === seat?.definition)?.pack;
  if (!seat || !pack) return undefined;
  const { position, rotation } = placementOf(seat);
  const front = headingOf(rotation);
  const [sin, cos] = [Math.sin(front), Math.cos(front)];
  const start = {
    x: position.x + AHEAD_M * sin + ASIDE_M * cos,
    z: position.z + AHEAD_M * cos - ASIDE_M * sin,
  };
  const [dx, dz] = [position.x - start.x, position.z - start.z];
  const target = [position.x - dx / 2, position.y + TARGET_HEIGHT_M, position.z - dz / 2];
  return {
    seat: seat.id,
    isFree: seat.state === 'OBJECT_STATE_FREE',
    pack,
    start,
    heading: Math.atan2(dx, dz),
    camera: [...target, front - ASIDE_RAD, POLAR_RAD, DISTANCE_M],
  };
}
