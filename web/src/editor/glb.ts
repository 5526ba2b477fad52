// Writes glb: a node a joint, and slim bones. glTF's axes and units are Troupe's own.
import {
  AnimationClip,
  BufferGeometry,
  Float32BufferAttribute,
  Mesh,
  MeshStandardMaterial,
  Object3D,
  Quaternion,
  QuaternionKeyframeTrack,
  Vector3,
  VectorKeyframeTrack,
} from 'three';
import { GLTFExporter } from 'three/examples/jsm/exporters/GLTFExporter.js';
import type { Clip, Rig } from './clip';
import { jointsOf } from './clip';

/** Bones shorter than this get no mesh, metres. */
const MIN_BONE_M = 1e-3;

/** Writes a clip as glb. */
export async function writeGlb(clip: Clip, rig: Rig): Promise<ArrayBuffer> {
  const { names, parents, offsets } = rig.skeleton;
  const material = new MeshStandardMaterial({ color: 0x1b6fd8, roughness: 0.8, flatShading: true });
  const nodes = names.map((name, j) => {
    const vertices = names.flatMap((_, child) =>
      parents[child] === j ? octahedron(new Vector3().fromArray(offsets, child * 3)) : [],
    );
    const node = vertices.length > 0 ? new Mesh(meshOf(vertices), material) : new Object3D();
    node.name = name;
    if (j > 0) node.position.fromArray(offsets, j * 3);
    return node;
  });
  nodes.forEach((node, j) => {
    if (j > 0) nodes[parents[j]!]!.add(node);
  });
  const joints = jointsOf(clip);
  const times = Float32Array.from({ length: clip.frames }, (_, f) => f / clip.fps);
  const tracks = nodes.map((node, j) => {
    const values = new Float32Array(clip.frames * 4);
    const [turn, before] = [new Quaternion(), new Quaternion()];
    for (let f = 0; f < clip.frames; f++) {
      turn.fromArray(clip.rotations, (f * joints + j) * 4);
      if (f > 0 && turn.dot(before) < 0) turn.set(-turn.x, -turn.y, -turn.z, -turn.w);
      before.copy(turn);
      turn.toArray(values, f * 4);
    }
    return new QuaternionKeyframeTrack(`${node.uuid}.quaternion`, times, values);
  });
  const root = nodes[0]!;
  root.position.fromArray(clip.roots);
  const moves = new VectorKeyframeTrack(`${root.uuid}.position`, times, clip.roots);
  const animation = new AnimationClip('motion', -1, [moves, ...tracks]);
  const written = await new GLTFExporter().parseAsync(root, { binary: true, animations: [animation] });
  for (const node of nodes) if (node instanceof Mesh) (node.geometry as BufferGeometry).dispose();
  material.dispose();
  return written as ArrayBuffer;
}

function meshOf(vertices: number[]): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new Float32BufferAttribute(vertices, 3));
  geometry.computeVertexNormals();
  return geometry;
}

/** Corners of the triangles of a slim octahedron from the origin to a bone's end. */
function octahedron(end: Vector3): number[] {
  const length = end.length();
  if (length < MIN_BONE_M) return [];
  const along = end.clone().divideScalar(length);
  const side = new Vector3(1, 0, 0);
  if (Math.abs(along.x) > 0.9) side.set(0, 1, 0);
  side.cross(along).normalize();
  const other = along.clone().cross(side);
  const waist = along.clone().multiplyScalar(length * 0.15);
  const ring = [0, 1, 2, 3].map((quarter) => {
    const [c, s] = [Math.cos((quarter * Math.PI) / 2), Math.sin((quarter * Math.PI) / 2)];
    return waist
      .clone()
      .addScaledVector(side, c * length * 0.08)
      .addScaledVector(other, s * length * 0.08);
  });
  const start = new Vector3();
  return ring.flatMap((corner, nth) => {
    const next = ring[(nth + 1) % 4]!;
    return [start, next, corner, end, corner, next].flatMap((point) => point.toArray());
  });
}
