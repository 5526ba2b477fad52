// A character for the tests: a skinned glb with Mixamo's names, made of a box for each bone.

/** A bone: name, parent's name, place in the parent at rest, metres. It stands with spread arms. */
type Bone = readonly [name: string, parent: string, x: number, y: number, z: number];

const SIDES = [
  ['Left', 1],
  ['Right', -1],
] as const;

const BONES: readonly Bone[] = [
  ['Hips', '', 0, 1.24, 0],
  ['Spine', 'Hips', 0, 0.13, 0],
  ['Spine1', 'Spine', 0, 0.15, 0],
  ['Spine2', 'Spine1', 0, 0.15, 0],
  ['Neck', 'Spine2', 0, 0.22, 0],
  ['Head', 'Neck', 0, 0.12, 0.02],
  ...SIDES.flatMap(([side, x]): Bone[] => [
    [`${side}Shoulder`, 'Spine2', 0.07 * x, 0.16, 0],
    [`${side}Arm`, `${side}Shoulder`, 0.14 * x, 0, 0],
    [`${side}ForeArm`, `${side}Arm`, 0.3 * x, 0, 0],
    [`${side}Hand`, `${side}ForeArm`, 0.28 * x, 0, 0],
    [`${side}HandIndex1`, `${side}Hand`, 0.11 * x, 0, 0],
    [`${side}UpLeg`, 'Hips', 0.11 * x, -0.06, 0],
    [`${side}Leg`, `${side}UpLeg`, 0, -0.54, 0.01],
    [`${side}Foot`, `${side}Leg`, 0, -0.53, -0.02],
    [`${side}ToeBase`, `${side}Foot`, 0, -0.08, 0.15],
  ]),
];

/** Half the width of a bone's box, metres. */
const HALF_M = 0.04;
const FLOAT = 5126;
const [SHORT, BYTE] = [5123, 5121];
const [JSON_CHUNK, BINARY_CHUNK] = [0x4e4f534a, 0x004e4942];

/** Number of the character's bones. */
export const HERO_BONES = BONES.length;

/** The character's file. Lengths are `size` times those above. */
export function heroGlb(size = 1): Uint8Array<ArrayBuffer> {
  const names = BONES.map(([name]) => name);
  const parents = BONES.map(([, parent]) => names.indexOf(parent));
  const places = BONES.map(([, , ...place]) => place.map((value) => value * size));
  const world: number[][] = [];
  places.forEach((place, b) => {
    const above = world[parents[b]!] ?? [0, 0, 0];
    world.push(place.map((value, c) => value + above[c]!));
  });
  const positions: number[] = [];
  const [joints, weights, triangles]: [number[], number[], number[]] = [[], [], []];
  for (let b = 0; b < names.length; b++) {
    const ends = parents.flatMap((parent, child) => (parent === b ? [world[child]!] : []));
    box(world[b]!, ends[0] ?? world[b]!, positions, triangles);
    for (let corner = 0; corner < 8; corner++) {
      joints.push(b, 0, 0, 0);
      weights.push(1, 0, 0, 0);
    }
  }
  const inverses = world.flatMap(([x, y, z]) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -x!, -y!, -z!, 1]);
  const file = new File();
  const attributes = {
    POSITION: file.add(new Float32Array(positions), FLOAT, 'VEC3'),
    JOINTS_0: file.add(new Uint8Array(joints), BYTE, 'VEC4'),
    WEIGHTS_0: file.add(new Float32Array(weights), FLOAT, 'VEC4'),
  };
  const indices = file.add(new Uint16Array(triangles), SHORT, 'SCALAR');
  const inverseBindMatrices = file.add(new Float32Array(inverses), FLOAT, 'MAT4');
  const nodes = names.map((name, b) => {
    const children = parents.flatMap((parent, child) => (parent === b ? [child] : []));
    return { name: `mixamorig:${name}`, translation: places[b], ...(children.length > 0 ? { children } : {}) };
  });
  return file.bytes({
    scene: 0,
    scenes: [{ nodes: [0, nodes.length] }],
    nodes: [...nodes, { name: 'mesh', mesh: 0, skin: 0 }],
    skins: [{ joints: names.map((_, b) => b), inverseBindMatrices, skeleton: 0 }],
    meshes: [{ primitives: [{ attributes, indices, material: 0 }] }],
    materials: [{ name: 'suit', pbrMetallicRoughness: { baseColorFactor: [0.1, 0.5, 0.35, 1], metallicFactor: 0 } }],
  });
}

/** Appends a box from one place to another. */
function box(from: readonly number[], to: readonly number[], positions: number[], triangles: number[]): void {
  const first = positions.length / 3;
  const [low, high] = [Math.min, Math.max].map((most, side) =>
    from.map((value, c) => most(value, to[c]!) + (side === 0 ? -HALF_M : HALF_M)),
  ) as [number[], number[]];
  for (let corner = 0; corner < 8; corner++) {
    positions.push(...[0, 1, 2].map((c) => (corner & (1 << c) ? high : low)[c]!));
  }
  const faces = [
    [0, 2, 3, 1],
    [4, 5, 7, 6],
    [0, 1, 5, 4],
    [2, 6, 7, 3],
    [0, 4, 6, 2],
    [1, 3, 7, 5],
  ] as const;
  for (const [a, b, c, d] of faces) triangles.push(...[a, b, c, a, c, d].map((corner) => first + corner));
}

/** A glb file while it grows. */
class File {
  private readonly views: object[] = [];
  private readonly accessors: object[] = [];
  private readonly parts: Uint8Array[] = [];
  private length = 0;

  /** Appends numbers. Returns the index of their accessor. */
  add(numbers: Float32Array | Uint8Array | Uint16Array, componentType: number, type: string): number {
    const width = { SCALAR: 1, VEC3: 3, VEC4: 4, MAT4: 16 }[type]!;
    const bytes = new Uint8Array(numbers.buffer);
    this.views.push({ buffer: 0, byteOffset: this.length, byteLength: bytes.length });
    this.push(bytes);
    const range = type === 'VEC3' ? { min: extreme(numbers, Math.min), max: extreme(numbers, Math.max) } : {};
    const view = { bufferView: this.views.length - 1, componentType, type, count: numbers.length / width };
    return this.accessors.push({ ...view, ...range }) - 1;
  }

  bytes(content: object): Uint8Array<ArrayBuffer> {
    const gltf = {
      asset: { version: '2.0' },
      ...content,
      buffers: [{ byteLength: this.length }],
      bufferViews: this.views,
      accessors: this.accessors,
    };
    const text = JSON.stringify(gltf);
    const json = new TextEncoder().encode(text.padEnd(Math.ceil(text.length / 4) * 4));
    const made = new Uint8Array(12 + 8 + json.length + 8 + this.length);
    const view = new DataView(made.buffer);
    const numbers = [0x46546c67, 2, made.length, json.length, JSON_CHUNK];
    numbers.forEach((value, i) => {
      view.setUint32(4 * i, value, true);
    });
    made.set(json, 20);
    let at = 20 + json.length;
    view.setUint32(at, this.length, true);
    view.setUint32(at + 4, BINARY_CHUNK, true);
    at += 8;
    for (const part of this.parts) {
      made.set(part, at);
      at += part.length;
    }
    return made;
  }

  private push(bytes: Uint8Array): void {
    const room = Math.ceil(bytes.length / 4) * 4;
    const part = new Uint8Array(room);
    part.set(bytes);
    this.parts.push(part);
    this.length += room;
  }
}

function extreme(numbers: ArrayLike<number>, most: (...values: number[]) => number): number[] {
  const found = [numbers[0]!, numbers[1]!, numbers[2]!];
  for (let i = 0; i < numbers.length; i++) found[i % 3] = most(found[i % 3]!, numbers[i]!);
  return found;
}
