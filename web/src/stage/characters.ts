// The characters on the stage: their joints, their bodies, and the skins that they wear.
import { Color, Group, type Object3D } from 'three';
import { CapsuleBody, type BodyView } from './body';
import { CapsuleField } from './capsules';
import { tintColour } from './colours';
import { checkSkeleton, Joints } from './kinematics';
import type { EdgeUniform } from './material';
import { hitCapsules, type Ray } from './picking';
import { rigOf } from './rig';
import { flatten, writeEnds, type FlatRig } from './rig-ends';
import { Skin } from './skin';
import { OtherBones } from './skin-fit';
import type { Carrier, CharacterLook, Pose, Skeleton, SkinReport, Theme } from './types';

const GHOST_OPACITY = 0.4;

interface Shape {
  rig: FlatRig;
  footprint_m: number;
  /** Equal for skeletons with equal joints and offsets. */
  key: string;
}

export interface Character {
  skeleton: Skeleton;
  shape: Shape;
  look: CharacterLook;
  joints: Joints;
  body: BodyView;
  /** Whether a pose has come. */
  isPosed: boolean;
}

interface Ghosts {
  bodies: BodyView[];
  opacity: number;
  tint: number;
}

export class Characters {
  readonly object = new Group();
  readonly all = new Map<string, Character>();
  private readonly solid: CapsuleField;
  private readonly ghostly: CapsuleField;
  private readonly shapes = new WeakMap<Skeleton, Shape>();
  /** What users gave, by the key of the skeleton. */
  private readonly skins = new Map<string, Skin>();
  /** What was read of the file of the person, and its skins; null for skeletons that it is not made for. */
  private person: Object3D | null = null;
  private askedPersons = 0;
  private readonly persons = new Map<string, Skin | null>();
  private readonly ghostSets = new Map<string, Ghosts>();
  private readonly colour = new Color();
  private ends = new Float32Array(0);
  private theme: Theme = 'light';

  constructor(private readonly edge: EdgeUniform) {
    this.solid = new CapsuleField(edge, false);
    this.ghostly = new CapsuleField(edge, true);
    this.object.add(this.solid.object, this.ghostly.object);
  }

  add(id: string, skeleton: Skeleton, look: CharacterLook): void {
    if (this.all.has(id)) throw new Error(`character ${id}: is on the stage already`);
    const shape = this.shapeOf(skeleton);
    const joints = new Joints(skeleton);
    const body = this.bodyOf(skeleton, shape, look);
    const character: Character = { skeleton, shape, look, joints, body, isPosed: false };
    this.all.set(id, character);
    this.paint(character);
  }

  remove(id: string): void {
    this.all.get(id)?.body.dispose();
    this.all.delete(id);
  }

  tint(id: string, tint: number): void {
    const character = this.get(id);
    character.look = { ...character.look, tint };
    this.paint(character);
  }

  pose(id: string, pose: Pose): void {
    const character = this.get(id);
    const needed = character.skeleton.names.length * 4;
    if (pose.rotations.length < needed)
      throw new Error(`pose of ${id}: has ${pose.rotations.length} numbers of rotations; ${needed} are needed`);
    character.joints.update(pose);
    character.body.pose(character.joints);
    character.isPosed = true;
  }

  ghosts(name: string, skeleton: Skeleton, poses: readonly Pose[] | null, opacity: number, tint: number): void {
    this.ghostSets.get(name)?.bodies.forEach((body) => {
      body.dispose();
    });
    this.ghostSets.delete(name);
    if (!poses || poses.length === 0) return;
    const { rig } = this.shapeOf(skeleton);
    const joints = new Joints(skeleton);
    const bodies = poses.map((pose) => {
      const body = new CapsuleBody(this.ghostly, rig, this.colour);
      joints.update(pose);
      body.pose(joints);
      return body;
    });
    const ghosts = { bodies, opacity, tint };
    this.ghostSets.set(name, ghosts);
    this.paintGhosts(ghosts);
  }

  async setSkin(skeleton: Skeleton, glb: ArrayBuffer | null, carrier?: Carrier): Promise<SkinReport | null> {
    const { key } = this.shapeOf(skeleton);
    const skin = glb && Skin.fit(skeleton, await Skin.read(glb), this.edge, carrier);
    const old = this.skins.get(key);
    if (skin) {
      this.skins.set(key, skin);
      this.object.add(skin.object);
    } else {
      this.skins.delete(key);
    }
    this.dress(key);
    old?.dispose();
    return skin?.report ?? null;
  }

  async setPerson(glb: ArrayBuffer | null): Promise<void> {
    const asked = ++this.askedPersons;
    const person = glb && (await Skin.read(glb));
    // Another skin was asked for meanwhile.
    if (asked !== this.askedPersons) return;
    this.person = person;
    const old = [...this.persons.values()];
    this.persons.clear();
    this.dress();
    for (const skin of old) skin?.dispose();
  }

  /** Whether a character wears a skin. */
  isSkinned(id: string): boolean {
    return !(this.all.get(id)?.body instanceof CapsuleBody);
  }

  setTheme(theme: Theme): void {
    this.theme = theme;
    for (const character of this.all.values()) this.paint(character);
    for (const ghosts of this.ghostSets.values()) this.paintGhosts(ghosts);
  }

  /** The nearest character on a ray, and how far along it is. */
  pick(ray: Ray): { id: string; distance: number } | null {
    let found: { id: string; distance: number } | null = null;
    for (const [id, { shape, joints, isPosed }] of this.all) {
      if (!isPosed) continue;
      const needed = shape.rig.count * 8;
      if (this.ends.length < needed) this.ends = new Float32Array(needed);
      writeEnds(shape.rig, joints, this.ends, 0);
      const distance = hitCapsules(ray, this.ends, 0, shape.rig.count);
      if (distance < (found?.distance ?? Infinity)) found = { id, distance };
    }
    return found;
  }

  /** Hands what has changed to the graphics card, `step_s` seconds after the last picture. */
  flush(step_s: number): void {
    for (const skin of this.skins.values()) skin.flush(step_s);
    this.solid.flush();
    this.ghostly.flush();
  }

  dispose(): void {
    for (const skin of [...this.skins.values(), ...this.persons.values()]) skin?.dispose();
    this.solid.dispose();
    this.ghostly.dispose();
    this.object.removeFromParent();
  }

  private get(id: string): Character {
    const character = this.all.get(id);
    if (!character) throw new Error(`character ${id}: is not on the stage`);
    return character;
  }

  private shapeOf(skeleton: Skeleton): Shape {
    const known = this.shapes.get(skeleton);
    if (known) return known;
    checkSkeleton(skeleton);
    const rig = rigOf(skeleton);
    const offsets = Array.from(skeleton.offsets, (metres) => Math.round(metres * 1e4));
    const key = `${skeleton.names.join('|')}/${skeleton.parents.join(',')}/${offsets.join(',')}`;
    const shape = { rig: flatten(rig), footprint_m: rig.footprint_m, key };
    this.shapes.set(skeleton, shape);
    return shape;
  }

  private bodyOf(skeleton: Skeleton, shape: Shape, look: CharacterLook): BodyView {
    if (look.ghost) return new CapsuleBody(this.ghostly, shape.rig, this.colour);
    const skin = this.skins.get(shape.key) ?? this.personOf(skeleton, shape);
    return skin?.wear() ?? new CapsuleBody(this.solid, shape.rig, this.colour);
  }

  /** The person's skin, for skeletons whose joints are exactly its bones. */
  private personOf(skeleton: Skeleton, { key }: Shape): Skin | null {
    const known = this.persons.get(key);
    if (known !== undefined || !this.person) return known ?? null;
    const skin = fitted(skeleton, this.person, this.edge);
    this.persons.set(key, skin);
    if (!skin) return null;
    this.object.add(skin.object);
    return skin;
  }

  /** Gives characters the bodies that they should have now: those of a skeleton, or all. */
  private dress(key?: string): void {
    for (const character of this.all.values()) {
      if ((key !== undefined && character.shape.key !== key) || character.look.ghost) continue;
      character.body.dispose();
      character.body = this.bodyOf(character.skeleton, character.shape, character.look);
      if (character.isPosed) character.body.pose(character.joints);
      this.paint(character);
    }
  }

  private paint({ body, look }: Character): void {
    body.tint(tintColour(look.tint, this.theme, this.colour), look.ghost ? GHOST_OPACITY : 1);
  }

  private paintGhosts({ bodies, opacity, tint }: Ghosts): void {
    for (const body of bodies) body.tint(tintColour(tint, this.theme, this.colour), opacity);
  }
}

/** A skin whose bones have the skeleton's own frames, or null. */
function fitted(skeleton: Skeleton, read: Object3D, edge: EdgeUniform): Skin | null {
  if (!Skin.hasBonesOf(skeleton, read)) return null;
  try {
    return Skin.fit(skeleton, read, edge);
  } catch (error) {
    if (error instanceof OtherBones) return null;
    throw error;
  }
}
