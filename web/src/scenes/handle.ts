// The handle that moves and turns the chosen object.
import type { Object3D } from 'three';
import { TransformControls } from 'three/examples/jsm/controls/TransformControls.js';
import type { Stage } from '../stage/types';

export class Handle {
  private readonly controls: TransformControls;
  private readonly helper: Object3D;
  /** Whether it is under way. */
  isDragged = false;

  /** `onMove` is called while it is dragged, `onEnd` when it is let go. */
  constructor(stage: Stage, onMove: () => void, onEnd: () => void) {
    const { camera, canvas, scene, controls: orbit } = stage.three;
    this.controls = new TransformControls(camera, canvas);
    this.controls.size = 0.8;
    this.helper = this.controls.getHelper();
    scene.add(this.helper);
    this.controls.addEventListener('dragging-changed', ({ value }) => {
      this.isDragged = value === true;
      orbit.enabled = !this.isDragged;
      if (!this.isDragged) onEnd();
    });
    this.controls.addEventListener('objectChange', onMove);
  }

  /** Whether the pointer is on it: a click is its then. */
  get isUnderPointer(): boolean {
    return this.controls.axis !== null;
  }

  show(object: Object3D | undefined, mode: 'move' | 'turn'): void {
    const { controls } = this;
    if (!object) {
      controls.detach();
      return;
    }
    controls.setMode(mode === 'move' ? 'translate' : 'rotate');
    // Objects stand: the handle turns them about the vertical alone.
    controls.showX = controls.showZ = mode === 'move';
    controls.setSpace('world');
    if (controls.object !== object) controls.attach(object);
  }

  dispose(): void {
    this.controls.detach();
    this.helper.removeFromParent();
    this.controls.dispose();
  }
}
