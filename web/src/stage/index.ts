// The stage: everything that is drawn in three dimensions.
import {
  Color,
  Fog,
  NeutralToneMapping,
  PCFShadowMap,
  Raycaster,
  Scene,
  Vector2,
  Vector3,
  WebGLRenderer,
  type Object3D,
} from 'three';
import { Characters, type Character } from './characters';
import { SURROUNDINGS } from './colours';
import { drawOnGround } from './draw';
import { Ground } from './ground';
import { Lights } from './light';
import { Overlays } from './overlays';
import { hitGround, type Ray } from './picking';
import type {
  Carrier,
  CharacterLook,
  DrawOptions,
  LineStyle,
  OnScreen,
  Picked,
  Pose,
  Skeleton,
  SkinReport,
  Stage,
  Theme,
} from './types';
import { View } from './view';

export type * from './types';
export { OtherBones } from './skin-fit';
export { ACCENT, PALETTE, tintColour } from './colours';

const MAX_PIXEL_RATIO = 2;
/** Frames that took longer than this count as this, so that nothing leaps after a pause, seconds. */
const LONGEST_FRAME_S = 0.1;
/** Tint of ghosts without one: the grey-blue of the pictures. */
const GHOST_TINT = 8;

/** Makes a stage on a canvas. The caller calls `render` once a frame and `resize` when the canvas has changed. */
export function createStage(canvas: HTMLCanvasElement, theme: Theme): Stage {
  return new TroupeStage(canvas, theme);
}

class TroupeStage implements Stage {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly view: View;
  private readonly ground: Ground;
  private readonly lights: Lights;
  private readonly overlays: Overlays;
  private readonly edge = { value: 0.6 };
  private readonly characters: Characters;
  private readonly fog = new Fog(0xffffff, 20, 60);
  private readonly objects = new Map<string, Object3D>();
  private readonly raycaster = new Raycaster();
  private readonly pointer = new Vector2();
  private readonly followed = new Vector3();
  private readonly size = new Vector2();
  private height_m = 0;
  private selected: string | null = null;
  private followId: string | null = null;
  private last_ms = performance.now();

  constructor(canvas: HTMLCanvasElement, theme: Theme) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: 'high-performance' });
    this.renderer.toneMapping = NeutralToneMapping;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.view = new View(canvas);
    this.ground = new Ground(this.scene);
    this.lights = new Lights(this.scene);
    this.overlays = new Overlays(this.scene);
    this.characters = new Characters(this.edge);
    this.scene.add(this.characters.object);
    this.scene.fog = this.fog;
    this.setTheme(theme);
    this.resize();
  }

  get three(): Stage['three'] {
    const { camera, controls } = this.view;
    return { scene: this.scene, camera, canvas: this.renderer.domElement, controls };
  }

  setTheme(theme: Theme): void {
    const of = SURROUNDINGS[theme];
    this.scene.background = new Color(of.background);
    this.fog.color.setHex(of.background);
    this.edge.value = of.edge;
    this.ground.setSurroundings(of);
    this.lights.setSurroundings(of);
    this.overlays.setTheme(theme);
    this.characters.setTheme(theme);
  }

  setGround(height_m: number): void {
    this.height_m = height_m;
    this.ground.setHeight(height_m);
  }

  add(id: string, skeleton: Skeleton, look: CharacterLook): void {
    this.characters.add(id, skeleton, look);
  }

  remove(id: string): void {
    this.characters.remove(id);
    if (this.selected === id) this.selected = null;
    if (this.followId === id) this.followId = null;
  }

  tint(id: string, tint: number): void {
    this.characters.tint(id, tint);
  }

  pose(id: string, pose: Pose): void {
    this.characters.pose(id, pose);
  }

  select(id: string | null): void {
    this.selected = id;
  }

  follow(id: string | null): void {
    this.followId = id;
  }

  pickable(name: string, object: Object3D | null): void {
    if (object) this.objects.set(name, object);
    else this.objects.delete(name);
  }

  pick(x: number, y: number): Picked {
    const ray = this.rayAt(x, y);
    const picked: Picked = {};
    const ground = hitGround(ray, this.height_m);
    if (ground) picked.ground = ground;
    const character = this.characters.pick(ray);
    const object = this.pickObject();
    const [near, far] = [character?.distance ?? Infinity, object?.distance ?? Infinity];
    if (character && near <= far) picked.character = character.id;
    else if (object) picked.object = object.name;
    return picked;
  }

  line(name: string, points: Float32Array | null, style: LineStyle): void {
    this.overlays.line(name, points, style);
  }

  discs(name: string, places: Float32Array | null, tint: number): void {
    this.overlays.discs(name, places, tint);
  }

  ghosts(name: string, skeleton: Skeleton, poses: Pose[] | null, opacity = 0.45, tint = GHOST_TINT): void {
    this.characters.ghosts(name, skeleton, poses, opacity, tint);
  }

  drawOnGround(options: DrawOptions): () => void {
    const { controls } = this.view;
    return drawOnGround(
      {
        canvas: this.renderer.domElement,
        ground: (x, y) => hitGround(this.rayAt(x, y), this.height_m) ?? undefined,
        holdCamera: (held) => {
          controls.enableRotate = !held;
        },
      },
      options,
    );
  }

  jointPositions(id: string): Float32Array | undefined {
    const character = this.characters.all.get(id);
    return character?.isPosed ? character.joints.positions : undefined;
  }

  setSkin(skeleton: Skeleton, glb: ArrayBuffer | null, carrier?: Carrier): Promise<SkinReport | null> {
    return this.characters.setSkin(skeleton, glb, carrier);
  }

  setPerson(glb: ArrayBuffer | null): Promise<void> {
    return this.characters.setPerson(glb);
  }

  isSkinned(id: string): boolean {
    return this.characters.all.has(id) && this.characters.isSkinned(id);
  }

  onScreen(id: string): OnScreen | undefined {
    const character = this.characters.all.get(id);
    if (!character?.isPosed) return undefined;
    const { camera } = this.view;
    camera.updateMatrixWorld();
    const { x, y, z } = this.middleOf(character).project(camera);
    const { clientWidth: width, clientHeight: height } = this.renderer.domElement;
    return Math.abs(z) > 1 ? undefined : { x: ((1 + x) / 2) * width, y: ((1 - y) / 2) * height, width, height };
  }

  onGrab(listener: (isGrabbed: boolean) => void): () => void {
    const { controls } = this.view;
    const [grab, letGo] = [
      () => {
        listener(true);
      },
      () => {
        listener(false);
      },
    ];
    controls.addEventListener('start', grab);
    controls.addEventListener('end', letGo);
    return () => {
      controls.removeEventListener('start', grab);
      controls.removeEventListener('end', letGo);
    };
  }

  cameraState(): number[] {
    return this.view.state();
  }

  setCamera(state: number[]): void {
    this.view.set(state);
  }

  zoom(factor: number): void {
    this.view.zoom(factor);
  }

  turn(left: number, up: number): void {
    this.view.turn(left, up);
  }

  cameraYaw(): number {
    return this.view.yaw();
  }

  render(): void {
    const now_ms = performance.now();
    const step_s = (now_ms - this.last_ms) / 1000;
    const seconds = Math.min(step_s, LONGEST_FRAME_S);
    this.last_ms = now_ms;
    const followed = this.followId === null ? undefined : this.characters.all.get(this.followId);
    this.view.update(seconds, followed?.isPosed ? this.middleOf(followed) : null);
    const { target } = this.view.controls;
    const distance = this.view.camera.position.distanceTo(target);
    this.fog.near = distance + 12;
    this.fog.far = distance * 2 + 50;
    this.ground.setFocus(target, 18 + distance * 2.2);
    this.lights.setFocus(target, Math.max(distance * 1.1, 7));
    this.placeRing();
    this.placeBlobs();
    this.characters.flush(step_s);
    this.renderer.render(this.scene, this.view.camera);
  }

  resize(): void {
    const { clientWidth, clientHeight } = this.renderer.domElement;
    const [width, height] = [Math.max(clientWidth, 1), Math.max(clientHeight, 1)];
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, MAX_PIXEL_RATIO));
    if (this.renderer.getSize(this.size).equals(new Vector2(width, height))) return;
    this.renderer.setSize(width, height, false);
    this.view.camera.aspect = width / height;
    this.view.camera.updateProjectionMatrix();
  }

  dispose(): void {
    for (const part of [this.characters, this.overlays, this.ground, this.lights, this.view, this.renderer])
      part.dispose();
  }

  /** Where the camera looks when it follows: above the ground under the root, at a share of its height. */
  private middleOf({ joints: { positions } }: Character): Vector3 {
    return this.followed.set(positions[0]!, Math.max(positions[1]! * 0.9, 0.2), positions[2]);
  }

  private placeRing(): void {
    const character = this.selected === null ? undefined : this.characters.all.get(this.selected);
    if (!character?.isPosed) {
      this.overlays.select(0, 0, 0, 0);
      return;
    }
    const { positions } = character.joints;
    this.overlays.select(positions[0]!, this.height_m, positions[2]!, character.shape.footprint_m * 1.25);
  }

  private placeBlobs(): void {
    const { all } = this.characters;
    const data = this.ground.blobsFor(all.size);
    let o = 0;
    for (const { joints, shape, isPosed, look } of all.values()) {
      data[o] = joints.positions[0]!;
      data[o + 1] = this.height_m + 0.002;
      data[o + 2] = joints.positions[2]!;
      data[o + 3] = isPosed && !look.ghost ? shape.footprint_m * 1.7 : 0;
      o += 4;
    }
  }

  /** The ray under a pointer; the raycaster keeps it for objects. */
  private rayAt(x: number, y: number): Ray {
    const box = this.renderer.domElement.getBoundingClientRect();
    this.pointer.set(((x - box.left) / box.width) * 2 - 1, 1 - ((y - box.top) / box.height) * 2);
    this.view.camera.updateMatrixWorld();
    this.raycaster.setFromCamera(this.pointer, this.view.camera);
    const { origin, direction } = this.raycaster.ray;
    return { origin: [origin.x, origin.y, origin.z], direction: [direction.x, direction.y, direction.z] };
  }

  private pickObject(): { name: string; distance: number } | null {
    let found: { name: string; distance: number } | null = null;
    for (const [name, object] of this.objects) {
      const [hit] = this.raycaster.intersectObject(object, true);
      if (hit && hit.distance < (found?.distance ?? Infinity)) found = { name, distance: hit.distance };
    }
    return found;
  }
}
