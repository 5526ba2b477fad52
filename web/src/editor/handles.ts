// Handles on a pose: a ball on each limb's end and on the root, and arrows or rings on the one that
// is selected.
import {
  Mesh,
  MeshBasicMaterial,
  Object3D,
  Plane,
  Quaternion,
  Raycaster,
  SphereGeometry,
  Vector2,
  Vector3,
} from 'three';
import { TransformControls } from 'three/examples/jsm/controls/TransformControls.js';
import { ACCENT, PALETTE } from '../stage';
import type { Stage } from '../stage/types';

export interface HandlePoint {
  name: string;
  place: Vector3;
  /** With it the handle turns too. */
  turn?: Quaternion;
}

export interface HandleEvents {
  onSelect: (name: string | undefined) => void;
  onMove: (name: string, place: Vector3, turn: Quaternion | undefined) => void;
  onEnd: () => void;
}

/** How near a pointer has to be to a ball's middle, and a ball's radius, pixels. */
const NEAR_PX = 16;
const RADIUS_PX = 7;
const BALL = new SphereGeometry(1, 20, 14);

export class Handles {
  private readonly object = new Object3D();
  private readonly balls = new Map<string, Mesh<SphereGeometry, MeshBasicMaterial>>();
  private readonly proxy = new Object3D();
  private readonly gizmo: TransformControls;
  private readonly abort = new AbortController();
  private points: readonly HandlePoint[] = [];
  private selected: string | undefined;
  private drag: { name: string; plane: Plane; offset: Vector3 } | undefined;
  private isGizmoDragged = false;

  constructor(
    private readonly stage: Stage,
    private readonly events: HandleEvents,
  ) {
    const { scene, camera, canvas, controls } = stage.three;
    this.gizmo = new TransformControls(camera, canvas);
    this.gizmo.setSize(0.62);
    this.gizmo.setColors(PALETTE[1], PALETTE[3], PALETTE[0], PALETTE[2]);
    this.gizmo.addEventListener('dragging-changed', ({ value }) => {
      this.isGizmoDragged = value === true;
      controls.enabled = !this.isGizmoDragged;
      if (!this.isGizmoDragged) events.onEnd();
    });
    this.gizmo.addEventListener('objectChange', () => {
      const { position, quaternion } = this.proxy;
      const point = this.points.find(({ name }) => name === this.selected);
      if (point) events.onMove(point.name, position.clone(), point.turn ? quaternion.clone() : undefined);
    });
    this.object.add(this.proxy);
    scene.add(this.object, this.gizmo.getHelper());
    const { signal } = this.abort;
    canvas.addEventListener('pointerdown', this.press, { signal, capture: true });
    canvas.addEventListener('pointermove', this.move, { signal });
    canvas.addEventListener('pointerup', this.release, { signal });
    canvas.addEventListener('pointercancel', this.release, { signal });
  }

  /** Where the handles are; none are shown for an empty list. */
  set(points: readonly HandlePoint[], selected: string | undefined, turns: boolean): void {
    this.points = points;
    this.selected = selected;
    for (const [name, ball] of this.balls) {
      if (points.some((point) => point.name === name)) continue;
      ball.removeFromParent();
      ball.material.dispose();
      this.balls.delete(name);
    }
    for (const { name, place } of points) this.ballOf(name).position.copy(place);
    const point = points.find(({ name }) => name === selected);
    if (!point) {
      this.gizmo.detach();
      return;
    }
    this.gizmo.setMode(turns && point.turn ? 'rotate' : 'translate');
    if (!this.isGizmoDragged) {
      this.proxy.position.copy(point.place);
      this.proxy.quaternion.copy(point.turn ?? new Quaternion());
    }
    if (this.gizmo.object !== this.proxy) this.gizmo.attach(this.proxy);
  }

  /** Keeps the balls the same size on the screen. */
  update(): void {
    const { camera, canvas } = this.stage.three;
    const perPixel = (2 * Math.tan((camera.fov * Math.PI) / 360)) / Math.max(canvas.clientHeight, 1);
    for (const [name, ball] of this.balls) {
      const isSelected = name === this.selected;
      ball.scale.setScalar(camera.position.distanceTo(ball.position) * perPixel * RADIUS_PX * (isSelected ? 1.25 : 1));
      ball.material.color.setHex(isSelected ? ACCENT : 0xffffff);
    }
  }

  /** Whether an arrow or a ring is under the pointer. */
  get isUnderPointer(): boolean {
    return this.gizmo.axis !== null;
  }

  /** Where a handle is on the page, pixels; for tests. */
  pixelOf(name: string): { x: number; y: number } | undefined {
    const point = this.points.find((one) => one.name === name);
    return point && this.toPage(point.place);
  }

  dispose(): void {
    const { controls } = this.stage.three;
    this.abort.abort();
    this.set([], undefined, false);
    this.gizmo.getHelper().removeFromParent();
    this.gizmo.dispose();
    this.object.removeFromParent();
    controls.enabled = true;
  }

  private ballOf(name: string): Mesh {
    const known = this.balls.get(name);
    if (known) return known;
    const material = new MeshBasicMaterial({ color: 0xffffff, depthTest: false, transparent: true, opacity: 0.92 });
    const ball = new Mesh(BALL, material);
    const rim = new Mesh(BALL, new MeshBasicMaterial({ color: ACCENT, depthTest: false, transparent: true }));
    rim.scale.setScalar(1.32);
    rim.renderOrder = 20;
    ball.renderOrder = 21;
    ball.add(rim);
    this.object.add(ball);
    this.balls.set(name, ball);
    return ball;
  }

  private toPage(place: Vector3): { x: number; y: number } {
    const { camera, canvas } = this.stage.three;
    const box = canvas.getBoundingClientRect();
    const { x, y } = place.clone().project(camera);
    return { x: box.left + ((x + 1) / 2) * box.width, y: box.top + ((1 - y) / 2) * box.height };
  }

  private nearest(event: PointerEvent): HandlePoint | undefined {
    const far = ({ place }: HandlePoint): number => {
      const { x, y } = this.toPage(place);
      return Math.hypot(x - event.clientX, y - event.clientY);
    };
    const [first] = [...this.points].sort((a, b) => far(a) - far(b));
    return first && far(first) <= NEAR_PX ? first : undefined;
  }

  /** Where the pointer's ray meets a plane. */
  private onPlane(event: PointerEvent, plane: Plane): Vector3 | null {
    const { camera, canvas } = this.stage.three;
    const box = canvas.getBoundingClientRect();
    const pointer = new Vector2(
      ((event.clientX - box.left) / box.width) * 2 - 1,
      1 - ((event.clientY - box.top) / box.height) * 2,
    );
    const raycaster = new Raycaster();
    raycaster.setFromCamera(pointer, camera);
    return raycaster.ray.intersectPlane(plane, new Vector3());
  }

  private readonly press = (event: PointerEvent): void => {
    // An arrow or a ring under the pointer goes first.
    if (event.button !== 0 || this.isUnderPointer) return;
    const point = this.nearest(event);
    if (!point) return;
    // Neither camera nor arrows get the press.
    event.stopImmediatePropagation();
    const { camera, canvas } = this.stage.three;
    canvas.setPointerCapture(event.pointerId);
    canvas.focus({ preventScroll: true });
    this.events.onSelect(point.name);
    const plane = new Plane().setFromNormalAndCoplanarPoint(camera.getWorldDirection(new Vector3()), point.place);
    const at = this.onPlane(event, plane);
    this.drag = { name: point.name, plane, offset: at ? point.place.clone().sub(at) : new Vector3() };
  };

  private readonly move = (event: PointerEvent): void => {
    const { drag } = this;
    if (!drag) {
      this.stage.three.canvas.style.cursor = this.nearest(event) ? 'grab' : '';
      return;
    }
    const at = this.onPlane(event, drag.plane);
    if (at) this.events.onMove(drag.name, at.add(drag.offset), undefined);
  };

  private readonly release = (): void => {
    if (!this.drag) return;
    this.drag = undefined;
    this.events.onEnd();
  };
}
