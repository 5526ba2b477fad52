// Lines and discs on the ground, by name.
import {
  BufferAttribute,
  BufferGeometry,
  CircleGeometry,
  DoubleSide,
  Group,
  Mesh,
  RingGeometry,
  ShaderMaterial,
  Color,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  type Scene,
} from 'three';
import { SURROUNDINGS, tintColour } from './colours';
import type { LineStyle, Theme } from './types';

/** Heights above the ground: enough that overlays do not flicker, and in an order. */
const LINE_Y = 0.006;
const DISC_Y = 0.009;
const RING_Y = 0.012;
const WIDTH_M = 0.045;
const DASH_M = 0.22;
const DISC_M = 0.055;

const RIBBON_VERTEX = `
attribute vec2 aAlong;
varying vec2 vAlong;
void main() {
  vAlong = aAlong;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

const RIBBON_FRAGMENT = `
uniform vec3 uColour;
uniform float uDash, uOpacity;
varying vec2 vAlong;
void main() {
  float side = 1.0 - smoothstep(1.0 - fwidth(vAlong.y) * 1.5, 1.0, abs(vAlong.y));
  float opacity = uOpacity * side;
  if (uDash > 0.0) {
    float at = abs(fract(vAlong.x / uDash) - 0.5);
    float soft = fwidth(vAlong.x) / uDash;
    opacity *= 1.0 - smoothstep(0.28 - soft, 0.28 + soft, at);
  }
  gl_FragColor = vec4(uColour, opacity);
  #include <colorspace_fragment>
}`;

const DISC_VERTEX = `
attribute vec3 aPlace;
varying vec2 vAt;
void main() {
  vAt = position.xy;
  vec3 place = aPlace + vec3(position.x, 0.0, -position.y) * ${DISC_M.toFixed(4)};
  gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
}`;

const DISC_FRAGMENT = `
uniform vec3 uColour;
varying vec2 vAt;
void main() {
  float away = length(vAt);
  float soft = fwidth(away) * 1.2;
  float rim = smoothstep(0.62 - soft, 0.62 + soft, away);
  float opacity = (1.0 - smoothstep(1.0 - soft, 1.0, away)) * mix(0.55, 1.0, rim);
  gl_FragColor = vec4(uColour, opacity);
  #include <colorspace_fragment>
}`;

interface Overlay {
  mesh: Mesh<BufferGeometry, ShaderMaterial>;
  tint: number;
}

/** A band on the ground: places 3 per vertex, and how far along (metres) and to which side (-1 to 1) it is. */
export interface Ribbon {
  places: Float32Array;
  along: Float32Array;
  index: Uint32Array;
}

/** Makes a band of a given width through points (3 per point); its height is theirs, a little raised. */
export function ribbon(points: Float32Array, width_m: number): Ribbon {
  const count = Math.floor(points.length / 3);
  const places = new Float32Array(count * 6);
  const along = new Float32Array(count * 4);
  const index = new Uint32Array(Math.max(count - 1, 0) * 6);
  let gone = 0;
  for (let p = 0; p < count; p++) {
    const [before, after] = [Math.max(p - 1, 0) * 3, Math.min(p + 1, count - 1) * 3];
    const dx = points[after]! - points[before]!,
      dz = points[after + 2]! - points[before + 2]!;
    const scale = width_m / 2 / (Math.hypot(dx, dz) || 1);
    const o = p * 3;
    if (p > 0) gone += Math.hypot(points[o]! - points[o - 3]!, points[o + 2]! - points[o - 1]!);
    for (const side of [1, -1]) {
      const v = p * 2 + (side < 0 ? 1 : 0);
      places.set([points[o]! + dz * scale * side, points[o + 1]! + LINE_Y, points[o + 2]! - dx * scale * side], v * 3);
      along.set([gone, side], v * 2);
    }
    if (p > 0) index.set([p * 2 - 2, p * 2 - 1, p * 2, p * 2 - 1, p * 2 + 1, p * 2], (p - 1) * 6);
  }
  return { places, along, index };
}

export class Overlays {
  private readonly group = new Group();
  private readonly lines = new Map<string, Overlay>();
  private readonly discMeshes = new Map<string, Overlay>();
  private readonly ring: Mesh<BufferGeometry, ShaderMaterial>;
  private theme: Theme = 'light';

  constructor(scene: Scene) {
    const geometry = new RingGeometry(0.82, 1, 96, 1).rotateX(-Math.PI / 2);
    const places = geometry.getAttribute('position');
    const along = new Float32Array(places.count * 2);
    for (let v = 0; v < places.count; v++)
      along[v * 2 + 1] = (Math.hypot(places.getX(v), places.getZ(v)) - 0.91) / 0.09;
    geometry.setAttribute('aAlong', new BufferAttribute(along, 2));
    this.ring = new Mesh(geometry, ribbonMaterial());
    this.ring.renderOrder = -4;
    this.ring.visible = false;
    this.group.add(this.ring);
    scene.add(this.group);
  }

  setTheme(theme: Theme): void {
    this.theme = theme;
    (this.ring.material.uniforms.uColour!.value as Color).setHex(SURROUNDINGS[theme].accent);
    for (const map of [this.lines, this.discMeshes]) for (const overlay of map.values()) this.paint(overlay);
  }

  line(name: string, points: Float32Array | null, style: LineStyle): void {
    this.forget(this.lines, name);
    if (!points || points.length < 6) return;
    const { places, along, index } = ribbon(points, style.width_m ?? WIDTH_M);
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(places, 3));
    geometry.setAttribute('aAlong', new BufferAttribute(along, 2));
    geometry.setIndex(new BufferAttribute(index, 1));
    const material = ribbonMaterial();
    material.uniforms.uDash!.value = style.dashed ? DASH_M : 0;
    this.keep(this.lines, name, { mesh: new Mesh(geometry, material), tint: style.tint }, -6);
  }

  discs(name: string, places: Float32Array | null, tint: number): void {
    this.forget(this.discMeshes, name);
    if (!places || places.length < 3) return;
    const geometry = new InstancedBufferGeometry();
    const circle = new CircleGeometry(1, 28);
    geometry.setAttribute('position', circle.getAttribute('position'));
    geometry.setIndex(circle.getIndex());
    const raised = places.slice(0, places.length - (places.length % 3));
    for (let p = 1; p < raised.length; p += 3) raised[p]! += DISC_Y;
    geometry.setAttribute('aPlace', new InstancedBufferAttribute(raised, 3));
    geometry.instanceCount = raised.length / 3;
    const material = new ShaderMaterial({
      vertexShader: DISC_VERTEX,
      fragmentShader: DISC_FRAGMENT,
      transparent: true,
      depthWrite: false,
      uniforms: { uColour: { value: new Color() } },
    });
    this.keep(this.discMeshes, name, { mesh: new Mesh(geometry, material), tint }, -5);
  }

  /** Puts the ring around a place, or hides it. */
  select(x: number, y: number, z: number, radius: number): void {
    this.ring.visible = radius > 0;
    this.ring.position.set(x, y + RING_Y, z);
    this.ring.scale.set(Math.max(radius, 1e-3), 1, Math.max(radius, 1e-3));
  }

  dispose(): void {
    for (const map of [this.lines, this.discMeshes]) for (const name of [...map.keys()]) this.forget(map, name);
    this.ring.geometry.dispose();
    this.ring.material.dispose();
    this.group.removeFromParent();
  }

  private keep(map: Map<string, Overlay>, name: string, overlay: Overlay, order: number): void {
    overlay.mesh.frustumCulled = false;
    overlay.mesh.renderOrder = order;
    this.paint(overlay);
    map.set(name, overlay);
    this.group.add(overlay.mesh);
  }

  private forget(map: Map<string, Overlay>, name: string): void {
    const overlay = map.get(name);
    if (!overlay) return;
    overlay.mesh.removeFromParent();
    overlay.mesh.geometry.dispose();
    overlay.mesh.material.dispose();
    map.delete(name);
  }

  private paint(overlay: Overlay): void {
    tintColour(overlay.tint, this.theme, overlay.mesh.material.uniforms.uColour!.value as Color);
  }
}

function ribbonMaterial(): ShaderMaterial {
  return new ShaderMaterial({
    vertexShader: RIBBON_VERTEX,
    fragmentShader: RIBBON_FRAGMENT,
    transparent: true,
    depthWrite: false,
    side: DoubleSide,
    uniforms: { uColour: { value: new Color() }, uDash: { value: 0 }, uOpacity: { value: 0.92 } },
  });
}
