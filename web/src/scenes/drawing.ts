// A scene on the stage: colliders, objects, and what is chosen.
import {
  EdgesGeometry,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  Raycaster,
  RingGeometry,
  Vector2,
} from 'three';
import type { BufferGeometry, Object3D, Vector3 } from 'three';
import type { Stage, Theme } from '../stage/types';
import { geometryOf, shapeOf } from './geometry';
import type { HeldTrack } from './held';
import type { Approach, Collider, Drawn, Placement, SceneObject } from './types';
import { placementOf } from './types';

/** Colliders are grey, objects light, reserved and held ones dark yellow: as in the project's pictures. */
const COLOURS = {
  light: {
    collider: 0xdde3e9,
    colliderEdge: 0xa9b4bf,
    object: 0xf3e2b3,
    used: 0xd9a014,
    edge: 0xa08a4a,
    accent: 0x1b6fd8,
  },
  dark: {
    collider: 0x3b4652,
    colliderEdge: 0x5d6b79,
    object: 0xcdb878,
    used: 0xd9a014,
    edge: 0x6f6235,
    accent: 0x5aa2f5,
  },
} as const;

/** Edges are drawn where faces meet at more than this, degrees. */
const EDGE_DEG = 25;
/** Where an approach without a distance is drawn, metres from the pivot. */
const NEAR_M = 0.8;

/** Faces are drawn a little behind their edges. */
const BEHIND_EDGES = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 } as const;

interface Parts {
  group: Group;
  mesh: Mesh<BufferGeometry, MeshStandardMaterial>;
  edges: LineSegments;
  definition: string;
}

interface Geometries {
  solid: BufferGeometry;
  edges: BufferGeometry;
}

export class SceneDrawing {
  private readonly root = new Group();
  private readonly colliders = new Group();
  private readonly objects = new Map<string, Parts>();
  private readonly shapes = new Map<Drawn, Geometries>();
  private readonly material = {
    collider: new MeshStandardMaterial({ roughness: 0.95, ...BEHIND_EDGES }),
    colliderEdge: new LineBasicMaterial(),
    object: new MeshStandardMaterial({ roughness: 0.8, ...BEHIND_EDGES }),
    used: new MeshStandardMaterial({ roughness: 0.8, ...BEHIND_EDGES }),
    edge: new LineBasicMaterial(),
    chosen: new LineBasicMaterial(),
    approach: new MeshBasicMaterial({ transparent: true, opacity: 0.28, depthWrite: false }),
  };
  private readonly raycaster = new Raycaster();
  private chosen: string | null = null;
  private sectors: Group | undefined;
  private readonly place = { position: new Float32Array(3), rotation: new Float32Array(4) };

  constructor(private readonly stage: Stage) {
    this.root.add(this.colliders);
    stage.three.scene.add(this.root);
  }

  setTheme(theme: Theme): void {
    const of = COLOURS[theme];
    const { material } = this;
    material.collider.color.setHex(of.collider);
    material.colliderEdge.color.setHex(of.colliderEdge);
    material.object.color.setHex(of.object);
    material.used.color.setHex(of.used);
    material.edge.color.setHex(of.edge);
    material.chosen.color.setHex(of.accent);
    material.approach.color.setHex(of.accent);
  }

  setColliders(colliders: readonly Collider[]): void {
    for (const child of this.colliders.children) freeGeometry(child);
    this.colliders.clear();
    for (const collider of colliders) {
      const shape = collider.shape && shapeOf(collider.shape);
      if (!shape) continue;
      const solid = geometryOf(shape);
      const mesh = new Mesh(solid, this.material.collider);
      mesh.castShadow = mesh.receiveShadow = true;
      const group = new Group();
      group.add(mesh, new LineSegments(new EdgesGeometry(solid, EDGE_DEG), this.material.colliderEdge));
      put(group, placementOf(collider));
      this.colliders.add(group);
    }
  }

  /** Draws the objects whose definitions are known; `moving` stays where the handle has it. */
  setObjects(objects: readonly SceneObject[], drawn: ReadonlyMap<string, Drawn>, moving: string | null): void {
    const left = new Set(this.objects.keys());
    for (const object of objects) {
      const of = drawn.get(object.definition);
      if (!of) continue;
      left.delete(object.id);
      const parts = this.partsOf(object, of);
      parts.mesh.material = object.state === 'OBJECT_STATE_FREE' ? this.material.object : this.material.used;
      if (object.id !== moving) put(parts.group, placementOf(object));
    }
    for (const id of left) this.drop(id);
    this.choose(this.chosen, drawn);
  }

  /** Shows an object in the hand that has it at a time of the stream. Returns whether one has. */
  showHeld(id: string, track: HeldTrack, time: number): boolean {
    const parts = this.objects.get(id);
    if (!parts || !track.sample(time, this.place.position, this.place.rotation)) return false;
    parts.group.position.fromArray(this.place.position);
    parts.group.quaternion.fromArray(this.place.rotation);
    return true;
  }

  /** Puts an object back where the scene has it. */
  settle(object: SceneObject): void {
    const parts = this.objects.get(object.id);
    if (parts) put(parts.group, placementOf(object));
  }

  object(id: string): Object3D | undefined {
    return this.objects.get(id)?.group;
  }

  /** Where an object is drawn. */
  placement(id: string): Placement | undefined {
    const group = this.objects.get(id)?.group;
    if (!group) return undefined;
    const { position: p, quaternion: q } = group;
    return { position: { x: p.x, y: p.y, z: p.z }, rotation: { w: q.w, x: q.x, y: q.y, z: q.z } };
  }

  /** Marks an object, and the sides from which it is used. */
  choose(id: string | null, drawn: ReadonlyMap<string, Drawn>): void {
    this.chosen = id;
    for (const [name, { edges }] of this.objects) {
      edges.material = name === id ? this.material.chosen : this.material.edge;
    }
    if (this.sectors) {
      this.sectors.removeFromParent();
      this.sectors.children.forEach(freeGeometry);
      this.sectors = undefined;
    }
    const parts = id === null ? undefined : this.objects.get(id);
    const of = parts && drawn.get(parts.definition);
    if (!of) return;
    this.sectors = new Group();
    this.sectors.position.set(of.pivot[0], of.pivot[1] + 0.01, of.pivot[2]);
    this.sectors.add(...of.approaches.map((approach) => this.sector(approach)));
    parts.group.add(this.sectors);
  }

  /** The place under a pointer: on a collider, an object, or the ground. */
  surface(x: number, y: number, ground: number): Vector3 | undefined {
    const { camera, canvas } = this.stage.three;
    const box = canvas.getBoundingClientRect();
    const at = new Vector2(((x - box.left) / box.width) * 2 - 1, 1 - ((y - box.top) / box.height) * 2);
    this.raycaster.setFromCamera(at, camera);
    const solid = [...this.colliders.children, ...[...this.objects.values()].map(({ mesh }) => mesh)];
    const [hit] = this.raycaster.intersectObjects(solid).filter(({ object }) => object instanceof Mesh);
    const { origin, direction } = this.raycaster.ray;
    const far = direction.y < -1e-4 ? (ground - origin.y) / direction.y : Infinity;
    if (hit && hit.distance < far) return hit.point;
    return far > 0 && far < 200 ? origin.clone().addScaledVector(direction, far) : undefined;
  }

  clear(): void {
    this.setColliders([]);
    for (const id of [...this.objects.keys()]) this.drop(id);
  }

  dispose(): void {
    this.clear();
    this.root.removeFromParent();
    for (const { solid, edges } of this.shapes.values()) {
      solid.dispose();
      edges.dispose();
    }
    for (const material of Object.values(this.material)) material.dispose();
  }

  private partsOf({ id, definition }: SceneObject, of: Drawn): Parts {
    const known = this.objects.get(id);
    const shapes = this.shapesOf(of);
    if (known) {
      known.mesh.geometry = shapes.solid;
      known.edges.geometry = shapes.edges;
      known.definition = definition;
      return known;
    }
    const mesh = new Mesh(shapes.solid, this.material.object);
    mesh.castShadow = mesh.receiveShadow = true;
    const edges = new LineSegments(shapes.edges, this.material.edge);
    const group = new Group();
    group.add(mesh, edges);
    this.root.add(group);
    const made: Parts = { group, mesh, edges, definition };
    this.objects.set(id, made);
    this.stage.pickable(id, mesh);
    return made;
  }

  private shapesOf(of: Drawn): Geometries {
    let found = this.shapes.get(of);
    if (!found) {
      const solid = geometryOf(of.shape);
      found = { solid, edges: new EdgesGeometry(solid, EDGE_DEG) };
      this.shapes.set(of, found);
    }
    return found;
  }

  private sector({ from, to, distance }: Approach): Mesh {
    const radius = distance ?? NEAR_M;
    const width = to >= from ? to - from : to - from + Math.PI * 2;
    const ring = new RingGeometry(Math.max(0.05, radius - 0.06), radius + 0.06, 48, 1, from - Math.PI / 2, width);
    return new Mesh(ring.rotateX(-Math.PI / 2), this.material.approach);
  }

  private drop(id: string): void {
    const parts = this.objects.get(id);
    if (!parts) return;
    parts.group.removeFromParent();
    this.stage.pickable(id, null);
    this.objects.delete(id);
  }
}

function put(group: Object3D, { position, rotation }: Placement): void {
  group.position.set(position.x, position.y, position.z);
  group.quaternion.set(rotation.x, rotation.y, rotation.z, rotation.w);
}

function freeGeometry(object: Object3D): void {
  object.traverse((part) => {
    if (part instanceof Mesh || part instanceof LineSegments) (part.geometry as BufferGeometry).dispose();
  });
}
