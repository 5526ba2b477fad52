// Where a crowd goes: each wanders within a circle and keeps a little away from the others.

/** Numbers from 0 to 1 that follow from a seed (mulberry32). */
export function randomFrom(seed: number): () => number {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let t = state;
    t = Math.imul(t ^ (t >>> 15), t | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

/** Radius of the circle that a crowd has to itself, metres. */
export function radiusFor(count: number): number {
  return 3 + 1.35 * Math.sqrt(count);
}

/** First places of a crowd: spread evenly over the circle (sunflower), with headings from the seed. */
export function places(count: number, seed: number): { x: number; z: number; heading: number }[] {
  const random = randomFrom(seed);
  const radius = radiusFor(count) * 0.9;
  return Array.from({ length: count }, (_, i) => {
    const far = radius * Math.sqrt((i + 0.5) / count);
    const angle = i * Math.PI * (3 - Math.sqrt(5)) + 0.3 * random();
    return { x: far * Math.sin(angle), z: far * Math.cos(angle), heading: (random() * 2 - 1) * Math.PI };
  });
}

export interface Neighbour {
  x: number;
  z: number;
}

/** Room that a character keeps to others, metres. */
const ROOM_M = 1.5;
/** Share of a character's decisions that are to stand for a while. */
const REST = 0.06;

/** Where one character wants to go. */
export class Wanderer {
  private heading: number;
  private readonly random: () => number;

  constructor(seed: number, heading: number) {
    this.random = randomFrom(seed);
    this.heading = heading;
  }

  /** Seconds until it thinks again. */
  pause(): number {
    return 1.6 + 1.8 * this.random();
  }

  /** The velocity that it wants, metres a second; `undefined` to stand. */
  decide(
    me: Neighbour,
    others: Iterable<Neighbour>,
    radius: number,
    speed: number,
  ): { x: number; z: number } | undefined {
    this.heading += (this.random() - 0.5) * 1.5;
    if (this.random() < REST) return undefined;
    let x = Math.sin(this.heading);
    let z = Math.cos(this.heading);
    const far = Math.hypot(me.x, me.z);
    if (far > radius * 0.8) {
      const pull = Math.min(3, ((far - radius * 0.8) / (radius * 0.2)) * 1.5);
      x -= (me.x / far) * pull;
      z -= (me.z / far) * pull;
    }
    for (const other of others) {
      const [dx, dz] = [me.x - other.x, me.z - other.z];
      const away = Math.hypot(dx, dz);
      if (away > 1e-6 && away < ROOM_M) {
        const push = (1.6 * (ROOM_M - away)) / ROOM_M / away;
        x += dx * push;
        z += dz * push;
      }
    }
    const length = Math.hypot(x, z);
    if (length < 1e-6) return undefined;
    this.heading = Math.atan2(x, z);
    const pace = speed * (0.85 + 0.3 * this.random());
    return { x: (x / length) * pace, z: (z / length) * pace };
  }
}
