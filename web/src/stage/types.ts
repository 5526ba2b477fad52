// The contract between the stage (three.js) and the rest of the viewer.
// Metres, Y up, +Z forward, X to the left, right-handed; quaternions are (x, y, z, w).

export interface Skeleton {
  names: readonly string[];
  /** Index of each joint's parent, -1 for the root. Parents come before their children. */
  parents: Int16Array;
  /** 3 per joint: the place in the parent's frame. */
  offsets: Float32Array;
}

/** One character's pose. Arrays may be views; they are read at once. */
export interface Pose {
  /** 3: place of the first joint. */
  root: Float32Array;
  /** 4 per joint, relative to the parent; the first joint's is in the world. */
  rotations: Float32Array;
  /** Per contact joint, 1 where it stands. */
  contacts?: Uint8Array;
}

/** Carries poses of a pack's skeleton over to a character with another one, for many members of a crowd. */
export interface Carrier {
  /** The character's own skeleton. Its joints are bones of the character's file. */
  readonly skeleton: Skeleton;
  /** Length of the character's legs by that of the pack's body. The stage draws it smaller by this. */
  readonly scale: number;
  /** Height of the ground, metres: the same in both sizes. */
  readonly ground_m: number;
  /** Makes room for members. */
  grow(members: number): void;
  /** A member begins a motion. */
  reset(member: number): void;
  /** Takes a member's pose on the pack's skeleton. */
  put(member: number, root: Float32Array, rotations: Float32Array): void;
  /** Carries over what was put since the last call, `passed_s` seconds ago. Feet turn by the time that has passed. */
  carry(passed_s: number): void;
  /** A member's pose in the character's own size, as views that are valid until the next call. */
  pose(member: number): Pose;
  dispose(): void;
}

export type Theme = 'light' | 'dark';

export interface CharacterLook {
  /** Index into the palette; any whole number counts. */
  tint: number;
  ghost?: boolean;
}

/** What lies under a pointer: the nearest of a character and an object, and the place on the ground behind it. */
export interface Picked {
  character?: string;
  object?: string;
  ground?: [number, number, number];
}

/** A place in the picture and the picture's size, in pixels of the page from the upper left. */
export interface OnScreen {
  x: number;
  y: number;
  width: number;
  height: number;
}

export interface LineStyle {
  tint: number;
  width_m?: number;
  dashed?: boolean;
}

/** What became of a skin. */
export interface SkinReport {
  /** Joints that move its bones. Other bones go along with the bone that they hang on. */
  joints: number;
  triangles: number;
}

export interface DrawOptions {
  /** Distance between points that are kept, metres. 0.1 without it. */
  spacing_m?: number;
  /** Called with all points so far, 3 per point, whenever one is added. */
  onDraw?: (points: Float32Array) => void;
  /** Called when the pointer is lifted. */
  onEnd: (points: Float32Array) => void;
}

export interface Stage {
  setTheme(theme: Theme): void;
  /** Height of the ground plane, metres; 0 at first. */
  setGround(height_m: number): void;
  /** Adds a character. A skeleton object that several characters share is worked out once. */
  add(id: string, skeleton: Skeleton, look: CharacterLook): void;
  remove(id: string): void;
  /** Changes the colour of a character. */
  tint(id: string, tint: number): void;
  /** Call once per character before render; cheap. */
  pose(id: string, pose: Pose): void;
  select(id: string | null): void;
  /** `x` and `y` are a pointer event's `clientX` and `clientY`. */
  pick(x: number, y: number): Picked;
  /** Makes an object of the scene pickable by name; null forgets it. */
  pickable(name: string, object: import('three').Object3D | null): void;
  follow(id: string | null): void;
  /** Overlays by name; null removes. Lines lie on the ground, 3 numbers per point. */
  line(name: string, points: Float32Array | null, style: LineStyle): void;
  ghosts(name: string, skeleton: Skeleton, poses: Pose[] | null, opacity?: number, tint?: number): void;
  discs(name: string, places: Float32Array | null, tint: number): void;
  /** Lets the pointer draw on the ground, while the camera rests. Returns a function that ends it. */
  drawOnGround(options: DrawOptions): () => void;
  /** Joint positions of a character as last posed, for labels, handles and tests (3 per joint). */
  jointPositions(id: string): Float32Array | undefined;
  /**
   * Gives all characters of a skeleton the skin of a glb file. Its bones are the skeleton's own joints, or a carrier's.
   * Throws `OtherBones` for a file that needs a carrier. null brings back what they looked like before. Skeletons with
   * equal joints and offsets share it. The stage disposes of the carrier.
   */
  setSkin(skeleton: Skeleton, glb: ArrayBuffer | null, carrier?: Carrier): Promise<SkinReport | null>;
  /**
   * Gives the skin of a glb file to all characters whose joints are exactly its bones, unless they have one by `setSkin`.
   * null brings the capsules back.
   */
  setPerson(glb: ArrayBuffer | null): Promise<void>;
  /** Whether a character wears a skin. */
  isSkinned(id: string): boolean;
  /** Where the middle of a character is in the picture, pixels; `undefined` if it is behind the camera or not posed. */
  onScreen(id: string): OnScreen | undefined;
  /** Hears when the pointer takes hold of the camera and lets go of it. Returns a function that ends it. */
  onGrab(listener: (isGrabbed: boolean) => void): () => void;
  /** Target (3), azimuth and polar angle (radians), distance (metres). */
  cameraState(): number[];
  setCamera(state: number[]): void;
  /** Brings the camera nearer by a factor above 1, farther by one below. */
  zoom(factor: number): void;
  /** Turns the camera around its target: to the left and up, radians. */
  turn(left: number, up: number): void;
  /** Yaw of the camera's view over the ground, for steering relative to it: 0 looks along +Z, π/2 along +X. */
  cameraYaw(): number;
  /** Draws one frame. */
  render(): void;
  resize(): void;
  dispose(): void;
  /** For modules that draw things of their own (objects, handles). */
  readonly three: {
    scene: import('three').Scene;
    camera: import('three').PerspectiveCamera;
    canvas: HTMLCanvasElement;
    controls: import('three/examples/jsm/controls/OrbitControls.js').OrbitControls;
  };
}
