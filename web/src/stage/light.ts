// Light: a sky, a key light whose shadow map follows the focus, and a weak light from behind.
import { DirectionalLight, HemisphereLight, Vector3, type Scene } from 'three';
import type { Surroundings } from './colours';

/** From the ground to the key light. */
const TO_KEY = new Vector3(-0.5, 1.05, 0.55).normalize();
const MAP_SIZE = 2048;
const AWAY_M = 40;

export class Lights {
  private readonly sky = new HemisphereLight();
  private readonly key = new DirectionalLight(0xfff6ea);
  private readonly fill = new DirectionalLight(0xcfe0ff);
  private extent = 0;
  private readonly right = new Vector3();
  private readonly up = new Vector3();
  private readonly centre = new Vector3();

  constructor(private readonly scene: Scene) {
    this.key.castShadow = true;
    this.key.shadow.mapSize.set(MAP_SIZE, MAP_SIZE);
    this.key.shadow.camera.near = 1;
    this.key.shadow.camera.far = AWAY_M * 2;
    this.key.shadow.normalBias = 0.02;
    this.key.shadow.bias = -0.0004;
    this.key.shadow.radius = 3;
    this.fill.position.set(0.6, 0.5, -1);
    this.right.set(0, 1, 0).cross(TO_KEY).normalize();
    this.up.copy(TO_KEY).cross(this.right);
    scene.add(this.sky, this.key, this.key.target, this.fill);
  }

  setSurroundings(of: Surroundings): void {
    this.sky.color.setHex(of.sky);
    this.sky.groundColor.setHex(of.bounce);
    this.sky.intensity = of.hemisphere;
    this.key.intensity = of.key;
    this.fill.intensity = of.fill;
  }

  /** Moves the shadow map over the focus; it covers `half` metres to each side. */
  setFocus(focus: Vector3, half: number): void {
    // In steps, so that shadows do not shimmer while the camera moves.
    const extent = 4 * 2 ** Math.ceil(Math.log2(Math.max(half, 4) / 4));
    if (extent !== this.extent) {
      this.extent = extent;
      const { camera } = this.key.shadow;
      camera.left = camera.bottom = -extent;
      camera.right = camera.top = extent;
      camera.updateProjectionMatrix();
    }
    const texel = (2 * extent) / MAP_SIZE;
    const along = Math.round(focus.dot(this.right) / texel) * texel;
    const above = Math.round(focus.dot(this.up) / texel) * texel;
    this.centre
      .copy(TO_KEY)
      .multiplyScalar(focus.dot(TO_KEY))
      .addScaledVector(this.right, along)
      .addScaledVector(this.up, above);
    this.key.target.position.copy(this.centre);
    this.key.position.copy(this.centre).addScaledVector(TO_KEY, AWAY_M);
  }

  dispose(): void {
    this.scene.remove(this.sky, this.key, this.key.target, this.fill);
    this.key.dispose();
  }
}
