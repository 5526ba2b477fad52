// The ground: a calm grid that fades into the background, and soft shadows on it.
import {
  CircleGeometry,
  Color,
  DynamicDrawUsage,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  PlaneGeometry,
  ShaderMaterial,
  ShadowMaterial,
  Vector3,
  Group,
  MultiplyBlending,
  type Scene,
} from 'three';
import type { Surroundings } from './colours';

/** Radius of the drawn ground, metres: beyond it the grid has faded. */
const RADIUS = 120;

const GRID_VERTEX = `
varying vec3 vPlace;
void main() {
  vec4 place = modelMatrix * vec4(position, 1.0);
  vPlace = place.xyz;
  gl_Position = projectionMatrix * viewMatrix * place;
}`;

const GRID_FRAGMENT = `
uniform vec3 uBackground, uGround, uGrid, uMajor, uFocus;
uniform float uReach;
varying vec3 vPlace;
// Share of a pixel that lines of a grid cover; lines that lie too close fade out.
float lines(vec2 place, float spacing, float width_px) {
  vec2 at = place / spacing;
  vec2 pixel = fwidth(at);
  vec2 near = abs(fract(at - 0.5) - 0.5) / max(pixel, 1e-6);
  vec2 cover = clamp(0.5 * width_px + 0.5 - near, 0.0, 1.0) * (1.0 - smoothstep(0.12, 0.45, pixel));
  return max(cover.x, cover.y);
}
void main() {
  float away = length(vPlace.xz - uFocus.xz) / uReach;
  float fade = 1.0 - smoothstep(0.12, 1.0, away);
  vec3 colour = mix(uBackground, uGround, fade);
  colour = mix(colour, uGrid, lines(vPlace.xz, 1.0, 1.0) * fade);
  colour = mix(colour, uMajor, lines(vPlace.xz, 5.0, 1.4) * fade);
  gl_FragColor = vec4(colour, 1.0);
  #include <colorspace_fragment>
}`;

const BLOB_VERTEX = `
attribute vec4 aBlob;
varying vec2 vAt;
void main() {
  vAt = position.xy;
  vec3 place = vec3(aBlob.x + position.x * aBlob.w, aBlob.y, aBlob.z + position.y * aBlob.w);
  gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
}`;

const BLOB_FRAGMENT = `
uniform float uStrength;
varying vec2 vAt;
void main() {
  float near = 1.0 - clamp(length(vAt), 0.0, 1.0);
  gl_FragColor = vec4(vec3(1.0 - uStrength * near * near), 1.0);
}`;

export class Ground {
  private readonly grid: ShaderMaterial;
  private readonly shadow = new ShadowMaterial({ transparent: true, depthWrite: false });
  private readonly shadowMesh: Mesh;
  private readonly mesh: Mesh;
  private readonly blobs = new InstancedBufferGeometry();
  private readonly blobMaterial: ShaderMaterial;
  private blobData = new Float32Array(0);
  private readonly group = new Group();
  private height_m = 0;

  constructor(scene: Scene) {
    this.grid = new ShaderMaterial({
      vertexShader: GRID_VERTEX,
      fragmentShader: GRID_FRAGMENT,
      depthWrite: false,
      uniforms: {
        uBackground: { value: new Color() },
        uGround: { value: new Color() },
        uGrid: { value: new Color() },
        uMajor: { value: new Color() },
        uFocus: { value: new Vector3() },
        uReach: { value: 40 },
      },
    });
    this.mesh = new Mesh(new CircleGeometry(RADIUS, 64).rotateX(-Math.PI / 2), this.grid);
    this.mesh.renderOrder = -10;
    this.shadowMesh = new Mesh(new PlaneGeometry(RADIUS, RADIUS).rotateX(-Math.PI / 2), this.shadow);
    this.shadowMesh.receiveShadow = true;
    this.shadowMesh.renderOrder = -8;
    this.blobMaterial = new ShaderMaterial({
      vertexShader: BLOB_VERTEX,
      fragmentShader: BLOB_FRAGMENT,
      blending: MultiplyBlending,
      premultipliedAlpha: true,
      transparent: true,
      depthWrite: false,
      uniforms: { uStrength: { value: 0.2 } },
    });
    const quad = new PlaneGeometry(2, 2);
    this.blobs.setAttribute('position', quad.getAttribute('position'));
    this.blobs.setIndex(quad.getIndex());
    // Seen from above, a quad in x and z winds the other way round.
    this.blobs.index?.array.reverse();
    this.blobs.instanceCount = 0;
    const blobs = new Mesh(this.blobs, this.blobMaterial);
    blobs.frustumCulled = false;
    blobs.renderOrder = -9;
    this.group.add(this.mesh, this.shadowMesh, blobs);
    scene.add(this.group);
  }

  setSurroundings(of: Surroundings): void {
    const { uBackground, uGround, uGrid, uMajor } = this.grid.uniforms;
    (uBackground!.value as Color).setHex(of.background);
    (uGround!.value as Color).setHex(of.ground);
    (uGrid!.value as Color).setHex(of.grid);
    (uMajor!.value as Color).setHex(of.gridMajor);
    this.shadow.color.setHex(0x0b1622);
    this.shadow.opacity = of.shadow;
    this.blobMaterial.uniforms.uStrength!.value = of.blob;
  }

  setHeight(height_m: number): void {
    this.height_m = height_m;
  }

  /** Centres what is drawn on the focus; `reach` is where the grid has faded, metres. */
  setFocus(focus: Vector3, reach: number): void {
    this.mesh.position.set(focus.x, this.height_m, focus.z);
    this.shadowMesh.position.set(focus.x, this.height_m, focus.z);
    (this.grid.uniforms.uFocus!.value as Vector3).copy(focus);
    this.grid.uniforms.uReach!.value = Math.min(reach, RADIUS * 0.9);
  }

  /** Room for soft shadows under so many bodies: place and radius, 4 numbers each, to be written by the caller. */
  blobsFor(count: number): Float32Array {
    if (this.blobData.length < count * 4) {
      this.blobData = new Float32Array(Math.max(count, 16) * 8);
      this.blobs.dispose();
      const attribute = new InstancedBufferAttribute(this.blobData, 4);
      attribute.setUsage(DynamicDrawUsage);
      this.blobs.setAttribute('aBlob', attribute);
    }
    this.blobs.instanceCount = count;
    const attribute = this.blobs.getAttribute('aBlob');
    if (count > 0) attribute.needsUpdate = true;
    return this.blobData;
  }

  dispose(): void {
    this.group.removeFromParent();
    this.mesh.geometry.dispose();
    this.shadowMesh.geometry.dispose();
    for (const part of [this.grid, this.shadow, this.blobs, this.blobMaterial]) part.dispose();
  }
}
