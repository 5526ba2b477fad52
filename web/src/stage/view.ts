// The camera: orbit, follow, reset, and its state as numbers.
import { PerspectiveCamera, Spherical, Vector3 } from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';

/** Target, azimuth, polar angle, distance. */
const START = [0, 0.85, 0, 0.6, 1.24, 6.2] as const;
const NEAREST_M = 0.8;
const FARTHEST_M = 70;
/** The camera stays above the ground, and the target near it. */
const LOWEST_M = 0.12;
const HIGHEST_TARGET_M = 12;
/** Time in which following comes most of the way, seconds. */
const FOLLOW_S = 0.28;

export class View {
  readonly camera = new PerspectiveCamera(38, 1, 0.1, 300);
  readonly controls: OrbitControls;
  private readonly spherical = new Spherical();
  private readonly offset = new Vector3();
  private readonly step = new Vector3();
  private readonly calm = window.matchMedia('(prefers-reduced-motion: reduce)');
  private readonly onCalm = (): void => {
    this.controls.enableDamping = !this.calm.matches;
  };

  constructor(canvas: HTMLCanvasElement) {
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.dampingFactor = 0.1;
    this.controls.minDistance = NEAREST_M;
    this.controls.maxDistance = FARTHEST_M;
    this.controls.minPolarAngle = 0.02;
    this.controls.maxPolarAngle = Math.PI / 2 - 0.015;
    this.controls.screenSpacePanning = false;
    this.controls.zoomToCursor = false;
    this.onCalm();
    this.calm.addEventListener('change', this.onCalm);
    this.reset();
  }

  /** Moves on by `seconds`. With a place to follow, the target comes to it and the camera keeps its distance. */
  update(seconds: number, follow: Vector3 | null): void {
    const { target } = this.controls;
    if (follow) {
      const share = this.calm.matches ? 1 : 1 - Math.exp(-seconds / FOLLOW_S);
      this.step.copy(follow).sub(target).multiplyScalar(share);
      target.add(this.step);
      this.camera.position.add(this.step);
    }
    this.controls.update(seconds);
    this.keepAbove();
  }

  state(): number[] {
    const { target } = this.controls;
    this.spherical.setFromVector3(this.offset.copy(this.camera.position).sub(target));
    const { theta, phi, radius } = this.spherical;
    return [target.x, target.y, target.z, theta, phi, radius].map((value) => Math.round(value * 1000) / 1000);
  }

  set(state: readonly number[]): void {
    if (state.length !== 6 || !state.every(Number.isFinite))
      throw new Error(`camera state: is [${state.join(', ')}]; six finite numbers are needed`);
    const [x, y, z, azimuth, polar, distance] = state as [number, number, number, number, number, number];
    const { controls } = this;
    controls.target.set(x, Math.min(Math.max(y, 0), HIGHEST_TARGET_M), z);
    this.spherical.set(
      Math.min(Math.max(distance, NEAREST_M), FARTHEST_M),
      Math.min(Math.max(polar, controls.minPolarAngle), controls.maxPolarAngle),
      azimuth,
    );
    this.camera.position.copy(controls.target).add(this.offset.setFromSpherical(this.spherical));
    this.camera.lookAt(controls.target);
    this.keepAbove();
    this.camera.updateMatrixWorld();
  }

  reset(): void {
    this.set(START);
  }

  zoom(factor: number): void {
    if (!(factor > 0)) throw new Error(`zoom factor: is ${factor}; it has to be above 0`);
    const state = this.state();
    state[5]! /= factor;
    this.set(state);
  }

  turn(left: number, up: number): void {
    const state = this.state();
    state[3]! += left;
    state[4]! -= up;
    this.set(state);
  }

  /** 0 looks along +Z, π/2 along +X. */
  yaw(): number {
    const { target } = this.controls;
    return Math.atan2(target.x - this.camera.position.x, target.z - this.camera.position.z);
  }

  dispose(): void {
    this.calm.removeEventListener('change', this.onCalm);
    this.controls.dispose();
  }

  private keepAbove(): void {
    const { target } = this.controls;
    target.y = Math.min(Math.max(target.y, 0), HIGHEST_TARGET_M);
    if (this.camera.position.y < LOWEST_M) {
      this.camera.position.y = LOWEST_M;
      this.camera.lookAt(target);
    }
  }
}
