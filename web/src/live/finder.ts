// Keeps a character in the picture: the camera comes along once the character has walked out of it.
import type { Stage } from '../stage/types';

/** How far a character goes out of the picture before the camera comes along, metres. */
const GOES_M = 0.5;
/** The camera has arrived when it looks this near to the character, metres. */
const ARRIVED_M = 0.15;
/** A character this near to an edge counts as out of the picture; share of the picture. */
const MARGIN = 0.03;
/** Panels take at most this share of the picture; on a narrow page they cover some of the rest. */
const MOST_PANELS = 0.25;
/** Largest distance of the camera once it has found the character on request, metres. */
const NEAR_M = 8;

type Place = readonly [x: number, z: number];

/** What the finder needs of the stage. */
export type FinderStage = Pick<
  Stage,
  'follow' | 'jointPositions' | 'onScreen' | 'cameraState' | 'setCamera' | 'onGrab'
>;

export class Finder {
  private id: string | undefined;
  /** Where the character was when it was last in the picture, or when the camera was last moved by hand. */
  private from: Place | undefined;
  private isComing = false;
  private isGrabbed = false;
  private readonly forget: () => void;

  /** `panels_px` gives the width of what covers the right of the picture. */
  constructor(
    private readonly stage: FinderStage,
    private readonly panels_px: () => number,
  ) {
    this.forget = stage.onGrab((isGrabbed) => {
      this.isGrabbed = isGrabbed;
      this.rest();
    });
  }

  /** One frame of the screen. While the camera follows a character anyway, the finder does nothing. */
  frame(id: string | undefined, isFollowing: boolean): void {
    const at = id === undefined ? undefined : this.placeOf(id);
    if (isFollowing) this.isComing = false;
    if (id === undefined || !at || isFollowing || this.isGrabbed) {
      this.rest();
      return;
    }
    const isNew = id !== this.id;
    if (isNew) this.rest();
    this.id = id;
    if (this.isComing) {
      const [x = 0, , z = 0] = this.stage.cameraState();
      if (apart(at, [x, z]) < ARRIVED_M) this.rest();
      return;
    }
    const isSeen = this.isInPicture(id);
    if (isSeen || !this.from) this.from = at;
    if (!isSeen && (isNew || apart(at, this.from) > GOES_M)) {
      this.isComing = true;
      this.stage.follow(id);
    }
  }

  /** Brings a character into the middle of the picture at once, and near enough to be seen. */
  find(id: string): void {
    const positions = this.stage.jointPositions(id);
    if (!positions) return;
    const [, , , azimuth = 0, polar = 1, distance = NEAR_M] = this.stage.cameraState();
    const [x = 0, y = 0, z = 0] = positions;
    this.stage.setCamera([x, y * 0.9, z, azimuth, polar, Math.min(distance, NEAR_M)]);
    this.rest();
  }

  /** Leaves the camera alone, until the character goes on out of the picture. */
  rest(): void {
    if (this.isComing) this.stage.follow(null);
    this.isComing = false;
    this.from = undefined;
  }

  dispose(): void {
    this.forget();
    this.rest();
  }

  private placeOf(id: string): Place | undefined {
    const positions = this.stage.jointPositions(id);
    return positions && [positions[0]!, positions[2]!];
  }

  private isInPicture(id: string): boolean {
    const place = this.stage.onScreen(id);
    if (!place) return false;
    const { x, y, width, height } = place;
    const right = width - Math.min(this.panels_px(), width * MOST_PANELS);
    const [aside, above] = [width * MARGIN, height * MARGIN];
    return x > aside && x < right - aside && y > above && y < height - above;
  }
}

/** Width of what the panels cover at the right of the page, pixels. */
export function panelsWidth(): number {
  const panels = document.querySelector('.side');
  return panels ? window.innerWidth - panels.getBoundingClientRect().left : 0;
}

function apart([x, z]: Place, [otherX, otherZ]: Place): number {
  return Math.hypot(x - otherX, z - otherZ);
}
