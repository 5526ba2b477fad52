// All capsules of all characters in one draw call: a round cone whose ends come from a buffer.
import {
  BufferAttribute,
  DynamicDrawUsage,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  InstancedInterleavedBuffer,
  InterleavedBufferAttribute,
  LessEqualDepth,
  Mesh,
  type Color,
  type Material,
  type Object3D,
} from 'three';
import { bodyMaterials, type BodyMaterials, type EdgeUniform } from './material';

const SEGMENTS = 14;
const RINGS = 5;
/** Numbers per capsule: place and radius of one end, then of the other. */
const STRIDE = 8;

const DECLARE = `
attribute vec3 aRound;
attribute vec4 aFrom;
attribute vec4 aTo;
attribute vec4 aColour;
varying vec4 vColour;
void bodyVertex(out vec3 place, out vec3 direction) {
  vColour = aColour;
  vec3 along = aTo.xyz - aFrom.xyz;
  float span = length(along);
  vec3 axis = span > 1e-6 ? along / span : vec3(0.0, 1.0, 0.0);
  vec3 aside = normalize(abs(axis.y) < 0.9 ? cross(axis, vec3(0.0, 1.0, 0.0)) : cross(axis, vec3(1.0, 0.0, 0.0)));
  vec3 across = cross(axis, aside);
  // Where the cone touches the spheres of its ends: the angle from the axis.
  float meet = acos(clamp((aFrom.w - aTo.w) / max(span, 1e-6), -0.95, 0.95));
  bool isFar = aRound.z > 0.5;
  float angle = isFar ? aRound.y * meet : meet + aRound.y * (3.14159265 - meet);
  direction = cos(angle) * axis + sin(angle) * (cos(aRound.x) * aside + sin(aRound.x) * across);
  place = (isFar ? aTo.xyz : aFrom.xyz) + (isFar ? aTo.w : aFrom.w) * direction;
}`;

/** A range of capsules in a field. */
export interface Slots {
  start: number;
  count: number;
}

/** Room for capsules of any number of characters. */
export class CapsuleField {
  readonly object: Object3D;
  /** 8 per capsule: from x y z radius, to x y z radius. Write here, then call `touch`. */
  ends: Float32Array;
  private readonly geometry = new InstancedBufferGeometry();
  private readonly materials: BodyMaterials;
  private colours: Float32Array;
  private buffer!: InstancedInterleavedBuffer;
  private colourAttribute!: InstancedBufferAttribute;
  private free: Slots[] = [];
  private used = 0;
  private isTouched = false;

  constructor(edge: EdgeUniform, isGhostly: boolean) {
    this.ends = new Float32Array(STRIDE * 64);
    this.colours = new Float32Array(4 * 64);
    const { round, index } = roundCone();
    // Only its count matters: three.js asks every geometry for positions.
    this.geometry.setAttribute('position', new BufferAttribute(new Float32Array(round.length), 3));
    // Without normals it would shade every triangle flat.
    this.geometry.setAttribute('normal', new BufferAttribute(new Float32Array(round.length), 3));
    this.geometry.setAttribute('aRound', new BufferAttribute(round, 3));
    this.geometry.setIndex(new BufferAttribute(index, 1));
    this.materials = bodyMaterials(DECLARE, edge, {});
    const mesh = new Mesh(this.geometry, this.materials.lit);
    mesh.frustumCulled = false;
    mesh.customDepthMaterial = this.materials.depth;
    mesh.castShadow = mesh.receiveShadow = !isGhostly;
    this.object = mesh;
    if (isGhostly) this.object = this.makeGhostly(mesh);
    this.rebind();
  }

  /** Takes room for capsules; their radii and colours are set by the caller. */
  take(count: number): Slots {
    const fit = this.free.findIndex((slots) => slots.count >= count);
    if (fit >= 0) {
      const slots = this.free[fit]!;
      if (slots.count === count) this.free.splice(fit, 1);
      else this.free[fit] = { start: slots.start + count, count: slots.count - count };
      return { start: slots.start, count };
    }
    const start = this.used;
    this.used += count;
    if (this.used * STRIDE > this.ends.length) this.grow();
    this.geometry.instanceCount = this.used;
    return { start, count };
  }

  /** Gives room back; what was there disappears. */
  release(slots: Slots): void {
    this.ends.fill(0, slots.start * STRIDE, (slots.start + slots.count) * STRIDE);
    this.free.push({ ...slots });
    this.mergeFree();
    this.touch();
  }

  /** Colour of one capsule; opacity counts in a ghostly field alone. */
  paint(capsule: number, colour: Color, opacity: number): void {
    this.colours.set([colour.r, colour.g, colour.b, opacity], capsule * 4);
    this.colourAttribute.needsUpdate = true;
  }

  /** Says that ends have changed. */
  touch(): void {
    this.isTouched = true;
  }

  /** Hands what has changed to the graphics card; call once a frame. */
  flush(): void {
    if (!this.isTouched) return;
    this.isTouched = false;
    this.buffer.clearUpdateRanges();
    this.buffer.addUpdateRange(0, this.used * STRIDE);
    this.buffer.needsUpdate = true;
  }

  dispose(): void {
    this.geometry.dispose();
    this.materials.dispose();
  }

  /** Neighbouring free ranges become one, and room at the end is no longer drawn. */
  private mergeFree(): void {
    this.free.sort((a, b) => a.start - b.start);
    const merged: Slots[] = [];
    for (const slots of this.free) {
      const last = merged[merged.length - 1];
      if (last && last.start + last.count === slots.start) last.count += slots.count;
      else merged.push(slots);
    }
    const last = merged[merged.length - 1];
    if (last && last.start + last.count === this.used) {
      this.used = last.start;
      merged.pop();
    }
    this.free = merged;
    this.geometry.instanceCount = this.used;
  }

  private grow(): void {
    const room = Math.max(this.used, (this.ends.length / STRIDE) * 2);
    const ends = new Float32Array(room * STRIDE);
    ends.set(this.ends);
    const colours = new Float32Array(room * 4);
    colours.set(this.colours);
    this.ends = ends;
    this.colours = colours;
    // The old buffers on the graphics card cannot grow.
    this.geometry.dispose();
    this.rebind();
  }

  private rebind(): void {
    this.buffer = new InstancedInterleavedBuffer(this.ends, STRIDE, 1);
    this.buffer.setUsage(DynamicDrawUsage);
    this.colourAttribute = new InstancedBufferAttribute(this.colours, 4);
    this.geometry.setAttribute('aFrom', new InterleavedBufferAttribute(this.buffer, 4, 0));
    this.geometry.setAttribute('aTo', new InterleavedBufferAttribute(this.buffer, 4, 4));
    this.geometry.setAttribute('aColour', this.colourAttribute);
    this.geometry.instanceCount = this.used;
    this.touch();
  }

  /** A body is seen through as a whole: its nearest surface is found first, then blended once. */
  private makeGhostly(mesh: Mesh): Object3D {
    const front = this.materials.lit;
    const behind: Material = this.materials.ghostDepth();
    const nearest = new Mesh(this.geometry, behind);
    nearest.frustumCulled = false;
    nearest.renderOrder = 5;
    front.transparent = true;
    front.depthWrite = false;
    front.depthFunc = LessEqualDepth;
    mesh.renderOrder = 6;
    mesh.add(nearest);
    return mesh;
  }
}

/** Angle around the axis, share of the cap's angle, and which end: 3 per vertex. */
function roundCone(): { round: Float32Array; index: Uint16Array } {
  const rows: [number, number][] = [];
  for (let r = 0; r <= RINGS; r++) rows.push([r / RINGS, 1]);
  for (let r = 0; r <= RINGS; r++) rows.push([r / RINGS, 0]);
  const round = new Float32Array(rows.length * (SEGMENTS + 1) * 3);
  const index: number[] = [];
  rows.forEach(([share, end], row) => {
    for (let s = 0; s <= SEGMENTS; s++) {
      const vertex = row * (SEGMENTS + 1) + s;
      round.set([(s / SEGMENTS) * 2 * Math.PI, share, end], vertex * 3);
      if (row === rows.length - 1 || s === SEGMENTS) continue;
      const below = vertex + SEGMENTS + 1;
      index.push(vertex, below, vertex + 1, vertex + 1, below, below + 1);
    }
  });
  return { round, index: new Uint16Array(index) };
}
