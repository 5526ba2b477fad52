// Skinned bodies: all characters with the same skin in one draw call per mesh, posed through a
// texture of bones.
import {
  Bone,
  BufferGeometry,
  DataTexture,
  DynamicDrawUsage,
  FloatType,
  Group,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Matrix4,
  Mesh,
  MeshStandardMaterial,
  NearestFilter,
  RGBAFormat,
  SkinnedMesh,
  type Color,
  type Object3D,
} from 'three';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
import type { BodyView } from './body';
import { forward } from './kinematics';
import { bodyMaterials, type BodyMaterials, type EdgeUniform } from './material';
import { fitBones, type Fit, type RestBone } from './skin-fit';
import type { Carrier, Pose, Skeleton, SkinReport } from './types';

const DECLARE = `
attribute vec4 skinIndex;
attribute vec4 skinWeight;
attribute float aRow;
attribute vec4 aColour;
uniform highp sampler2D uBones;
varying vec4 vColour;
vec4 boneRow(float bone, int row) {
  return texelFetch(uBones, ivec2(int(bone) * 3 + row, int(aRow)), 0);
}
void bodyVertex(out vec3 place, out vec3 direction) {
  vColour = aColour;
  vec4 rows[3];
  for (int row = 0; row < 3; row++) {
    rows[row] = skinWeight.x * boneRow(skinIndex.x, row) + skinWeight.y * boneRow(skinIndex.y, row)
      + skinWeight.z * boneRow(skinIndex.z, row) + skinWeight.w * boneRow(skinIndex.w, row);
  }
  vec4 at = vec4(position, 1.0);
  place = vec3(dot(rows[0], at), dot(rows[1], at), dot(rows[2], at));
  direction = vec3(dot(rows[0].xyz, normal), dot(rows[1].xyz, normal), dot(rows[2].xyz, normal));
}`;

/** One mesh of a skin with all its instances. */
interface Part {
  geometry: InstancedBufferGeometry;
  materials: BodyMaterials;
  /** Bones of the fit, in the order of the mesh's own indices. */
  bones: Int16Array;
  /** 12 per bone: from the mesh to the joint that moves the bone, by rows. */
  constants: Float32Array;
  texture: DataTexture;
  /** 12 per bone and row of the texture. */
  data: Float32Array;
  rows: InstancedBufferAttribute;
  colours: InstancedBufferAttribute;
  /** Whether the file's own colours count, so that tints do not. */
  isPainted: boolean;
}

/** A skin and all characters that wear it. */
export class Skin {
  readonly object = new Group();
  readonly report: SkinReport;
  private readonly fit: Fit;
  private readonly parts: Part[] = [];
  private capacity = 16;
  private readonly taken: boolean[] = [];
  /** Rows whose pose the carrier has, but the picture not yet. */
  private readonly waiting = new Set<number>();
  /** Time since poses were last carried over, seconds. */
  private passed_s = 0;
  private readonly positions: Float32Array;
  private readonly rotations: Float32Array;

  private constructor(
    skeleton: Skeleton,
    root: Object3D,
    edge: EdgeUniform,
    private readonly carrier: Carrier | undefined,
  ) {
    root.updateMatrixWorld(true);
    const meshes: SkinnedMesh[] = [];
    root.traverse((node) => {
      if (node instanceof SkinnedMesh) meshes.push(node as SkinnedMesh);
    });
    if (meshes.length === 0)
      throw new Error('The glb file has no skinned mesh: it needs a mesh with a skin (joints and weights).');
    const { bones, indices } = restBones(meshes);
    this.fit = fitBones(skeleton, bones);
    carrier?.grow(this.capacity);
    this.positions = new Float32Array(skeleton.names.length * 3);
    this.rotations = new Float32Array(skeleton.names.length * 4);
    for (const mesh of meshes) this.addPart(mesh, indices, edge);
    const triangles = meshes.reduce((sum, { geometry }) => {
      return sum + (geometry.index?.count ?? geometry.getAttribute('position').count) / 3;
    }, 0);
    this.report = { joints: this.fit.joints, triangles };
  }

  /** Reads a glb file. */
  static async read(glb: ArrayBuffer): Promise<Object3D> {
    const gltf = await new GLTFLoader().parseAsync(glb, '').catch((error: unknown) => {
      throw new Error(
        `The file is not a glb that can be read: ${error instanceof Error ? error.message : String(error)}`,
      );
    });
    return gltf.scene;
  }

  /** Fits what was read to a skeleton, or to the carrier's own. Throws an error that says what does not fit. */
  static fit(skeleton: Skeleton, read: Object3D, edge: EdgeUniform, carrier?: Carrier): Skin {
    return new Skin(carrier?.skeleton ?? skeleton, read, edge, carrier);
  }

  /** Whether what was read has a bone of each joint's name, and no other bones. */
  static hasBonesOf({ names }: Skeleton, read: Object3D): boolean {
    const bones = new Set<string>();
    read.traverse((node) => {
      if (node instanceof Bone) bones.add(nameOf(node));
    });
    return bones.size === names.length && names.every((name) => bones.has(name));
  }

  /** A body that wears this skin. */
  wear(): BodyView {
    let row = this.taken.findIndex((isTaken) => !isTaken);
    if (row < 0) row = this.taken.push(true) - 1;
    this.taken[row] = true;
    if (row >= this.capacity) this.grow(row + 1);
    this.carrier?.reset(row);
    this.listRows();
    const body = row;
    return {
      pose: (joints) => {
        if (this.carrier) {
          this.carrier.put(body, joints.positions.subarray(0, 3), joints.local);
          this.waiting.add(body);
        } else {
          this.write(body, joints.positions, joints.rotations);
        }
      },
      tint: (colour, opacity) => {
        this.tint(body, colour, opacity);
      },
      dispose: () => {
        this.taken[body] = false;
        this.waiting.delete(body);
        this.listRows();
      },
    };
  }

  /** Carries over the poses that wait. Call it before each picture, `step_s` seconds after the last one. */
  flush(step_s: number): void {
    this.passed_s += step_s;
    if (!this.carrier || this.waiting.size === 0) return;
    this.carrier.carry(this.passed_s);
    this.passed_s = 0;
    for (const row of this.waiting) this.writeCarried(row, this.carrier, this.carrier.pose(row));
    this.waiting.clear();
  }

  dispose(): void {
    this.object.removeFromParent();
    this.carrier?.dispose();
    for (const part of this.parts) {
      part.geometry.dispose();
      part.materials.dispose();
      part.texture.dispose();
    }
  }

  /** A pose of the carrier, at the size of the pack's body: roots over the ground stay where the server has them. */
  private writeCarried(row: number, { skeleton, scale, ground_m }: Carrier, { root, rotations }: Pose): void {
    const { positions } = this;
    forward(skeleton, root, rotations, positions, this.rotations);
    for (let p = 0; p < positions.length; p += 3) {
      positions[p]! /= scale;
      positions[p + 1] = (positions[p + 1]! - ground_m) / scale + ground_m;
      positions[p + 2]! /= scale;
    }
    this.write(row, positions, this.rotations);
  }

  /** Places (3) and rotations (4) of the joints in the world. */
  private write(row: number, positions: Float32Array, rotations: Float32Array): void {
    for (const part of this.parts) {
      const count = part.bones.length;
      let o = row * count * 12;
      for (let b = 0; b < count; b++, o += 12) {
        const joint = this.fit.drivers[part.bones[b]!]!;
        writeBone(rotations, joint * 4, positions, joint * 3, part.constants, b * 12, part.data, o);
      }
      part.texture.needsUpdate = true;
    }
  }

  private tint(row: number, colour: Color, opacity: number): void {
    for (const { colours, isPainted } of this.parts) {
      if (isPainted) colours.setXYZW(row, 1, 1, 1, opacity);
      else colours.setXYZW(row, colour.r, colour.g, colour.b, opacity);
    }
    this.listRows();
  }

  /** Instances are the rows that are taken, one after the other. */
  private listRows(): void {
    for (const part of this.parts) {
      let count = 0;
      this.taken.forEach((isTaken, row) => {
        if (!isTaken) return;
        part.rows.setX(count, row);
        const shown = part.geometry.getAttribute('aColour');
        for (let c = 0; c < 4; c++) shown.setComponent(count, c, part.colours.getComponent(row, c));
        shown.needsUpdate = true;
        count++;
      });
      part.rows.needsUpdate = true;
      part.geometry.instanceCount = count;
    }
  }

  private grow(rows: number): void {
    this.capacity = Math.max(this.capacity * 2, rows);
    this.carrier?.grow(this.capacity);
    for (const part of this.parts) {
      const { data, colours } = part;
      part.texture.dispose();
      part.geometry.dispose();
      makeRoom(part, this.capacity);
      part.data.set(data);
      (part.colours.array as Float32Array).set(colours.array);
    }
  }

  private addPart(mesh: SkinnedMesh, indices: Map<string, number>, edge: EdgeUniform): void {
    const bones = Int16Array.from(mesh.skeleton.bones, (bone) => indices.get(bone.uuid)!);
    const constants = new Float32Array(bones.length * 12);
    const matrix = new Matrix4();
    const size = new Matrix4();
    if (this.carrier) size.makeScale(1 / this.carrier.scale, 1 / this.carrier.scale, 1 / this.carrier.scale);
    bones.forEach((bone, b) => {
      matrix
        .copy(size)
        .multiply(this.fit.relative[bone]!)
        .multiply(mesh.skeleton.boneInverses[b]!)
        .multiply(mesh.bindMatrix);
      toRows(matrix, constants, b * 12);
    });
    const material = (Array.isArray(mesh.material) ? mesh.material[0] : mesh.material) as unknown;
    const base = material instanceof MeshStandardMaterial ? material : undefined;
    const isPainted = base !== undefined && (base.map !== null || base.name !== 'body');
    const part = {
      geometry: shared(mesh.geometry),
      bones,
      constants,
      isPainted,
      materials: bodyMaterials(DECLARE, edge, { uBones: { value: null } }, base),
    } as Part;
    makeRoom(part, this.capacity);
    this.parts.push(part);
    const shown = new Mesh(part.geometry, part.materials.lit);
    shown.customDepthMaterial = part.materials.depth;
    shown.frustumCulled = false;
    shown.castShadow = shown.receiveShadow = true;
    this.object.add(shown);
  }
}

/** Buffers for so many characters. */
function makeRoom(part: Part, rows: number): void {
  const width = part.bones.length * 3;
  part.data = new Float32Array(width * 4 * rows);
  part.texture = new DataTexture(part.data, width, rows, RGBAFormat, FloatType);
  part.texture.minFilter = part.texture.magFilter = NearestFilter;
  part.materials.uniforms.uBones!.value = part.texture;
  part.rows = new InstancedBufferAttribute(new Float32Array(rows), 1);
  part.rows.setUsage(DynamicDrawUsage);
  part.colours = new InstancedBufferAttribute(new Float32Array(rows * 4), 4);
  part.geometry.setAttribute('aRow', part.rows);
  part.geometry.setAttribute('aColour', new InstancedBufferAttribute(new Float32Array(rows * 4), 4));
}

/** The mesh's own buffers, to be drawn many times. */
function shared(geometry: BufferGeometry): InstancedBufferGeometry {
  const instanced = new InstancedBufferGeometry();
  for (const [name, attribute] of Object.entries(geometry.attributes)) instanced.setAttribute(name, attribute);
  instanced.setIndex(geometry.index);
  if (!geometry.hasAttribute('normal')) instanced.computeVertexNormals();
  instanced.instanceCount = 0;
  return instanced;
}

/** All bones of all meshes with their places in the file, parents first. */
function restBones(meshes: readonly SkinnedMesh[]): { bones: RestBone[]; indices: Map<string, number> } {
  const all = new Set<Object3D>(meshes.flatMap(({ skeleton }) => skeleton.bones));
  const indices = new Map<string, number>();
  const bones: RestBone[] = [];
  const visit = (bone: Object3D): number => {
    const known = indices.get(bone.uuid);
    if (known !== undefined) return known;
    const parent = bone.parent && all.has(bone.parent) ? visit(bone.parent) : -1;
    indices.set(bone.uuid, bones.length);
    return bones.push({ name: nameOf(bone), parent, world: bone.matrixWorld.clone() }) - 1;
  };
  for (const bone of all) visit(bone);
  return { bones, indices };
}

/** A node's name in the file: three.js changes some letters. */
function nameOf(node: Object3D): string {
  return (node.userData as { name?: string }).name ?? node.name;
}

function toRows(matrix: Matrix4, out: Float32Array, o: number): void {
  const { elements } = matrix;
  for (let row = 0; row < 3; row++)
    for (let column = 0; column < 4; column++) out[o + row * 4 + column] = elements[column * 4 + row]!;
}

/** `out = [rotation | place] * constant`, all as 3 rows of 4. */
function writeBone(
  turns: Float32Array,
  q: number,
  places: Float32Array,
  p: number,
  constant: Float32Array,
  c: number,
  out: Float32Array,
  o: number,
): void {
  const x = turns[q]!,
    y = turns[q + 1]!,
    z = turns[q + 2]!,
    w = turns[q + 3]!;
  const xx = 2 * x * x,
    yy = 2 * y * y,
    zz = 2 * z * z,
    xy = 2 * x * y,
    xz = 2 * x * z,
    yz = 2 * y * z;
  const wx = 2 * w * x,
    wy = 2 * w * y,
    wz = 2 * w * z;
  const a0 = 1 - yy - zz,
    a1 = xy - wz,
    a2 = xz + wy;
  const b0 = xy + wz,
    b1 = 1 - xx - zz,
    b2 = yz - wx;
  const c0 = xz - wy,
    c1 = yz + wx,
    c2 = 1 - xx - yy;
  for (let k = 0; k < 4; k++) {
    const r0 = constant[c + k]!,
      r1 = constant[c + 4 + k]!,
      r2 = constant[c + 8 + k]!;
    out[o + k] = a0 * r0 + a1 * r1 + a2 * r2;
    out[o + 4 + k] = b0 * r0 + b1 * r1 + b2 * r2;
    out[o + 8 + k] = c0 * r0 + c1 * r1 + c2 * r2;
  }
  out[o + 3]! += places[p]!;
  out[o + 7]! += places[p + 1]!;
  out[o + 11]! += places[p + 2]!;
}
