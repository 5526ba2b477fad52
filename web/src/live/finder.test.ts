import { beforeEach, describe, expect, test } from 'vitest';
import type { FinderStage } from './finder';
import { Finder } from './finder';

/** A stage 1000 pixels wide that looks straight down: a metre is 100 pixels, its middle shows what the camera looks at. */
class FlatStage implements FinderStage {
  camera = [0, 0, 0, 0.5, 1, 12];
  followed: string | null = null;
  readonly places = new Map<string, [number, number]>();
  grab: (isGrabbed: boolean) => void = () => undefined;

  follow(id: string | null): void {
    this.followed = id;
  }

  jointPositions(id: string): Float32Array | undefined {
    const place = this.places.get(id);
    return place && Float32Array.of(place[0], 1, place[1]);
  }

  onScreen(id: string) {
    const place = this.places.get(id);
    return (
      place && {
        x: 500 + (place[0] - this.camera[0]!) * 100,
        y: 300 + (place[1] - this.camera[2]!) * 100,
        width: 1000,
        height: 600,
      }
    );
  }

  cameraState(): number[] {
    return this.camera;
  }

  setCamera(state: number[]): void {
    this.camera = state;
  }

  onGrab(listener: (isGrabbed: boolean) => void): () => void {
    this.grab = listener;
    return () => undefined;
  }
}

let stage: FlatStage;
let finder: Finder;

/** Puts the character somewhere and shows a frame. */
function shows(x: number, z: number, id = 'own'): string | null {
  stage.places.set(id, [x, z]);
  finder.frame(id, false);
  return stage.followed;
}

beforeEach(() => {
  stage = new FlatStage();
  finder = new Finder(stage, () => 200);
});

describe('the camera', () => {
  test('stays while the character is in the picture', () => {
    for (const x of [0, 1, 2, 2.6]) expect(shows(x, 0)).toBeNull();
  });

  test('comes along when the character has left the picture, until it has arrived', () => {
    shows(0, 0);
    shows(0, 2.7);
    expect(shows(0, 3)).toBeNull();
    expect(shows(0, 3.3)).toBe('own');
    stage.camera[2] = 3;
    expect(shows(0, 3.6)).toBe('own');
    stage.camera[2] = 3.5;
    expect(shows(0, 3.6)).toBeNull();
  });

  test('counts what is behind the panels as out of the picture, up to a quarter of it', () => {
    shows(0, 0);
    expect(shows(2.9, 0)).toBe('own');
    finder.rest();
    finder = new Finder(stage, () => 900);
    shows(0, 0);
    expect(shows(2.1, 0)).toBeNull();
  });

  test('comes at once to a character that begins out of the picture', () => {
    expect(shows(0, 9)).toBe('own');
    stage.camera = [0, 0, 9, 0.5, 1, 12];
    expect(shows(0, 9)).toBeNull();
    expect(shows(20, 0, 'other')).toBe('other');
  });

  test('stays as it was turned by hand, until the character goes on', () => {
    shows(0, 0);
    stage.grab(true);
    stage.camera = [50, 0, 0, 0.5, 1, 12];
    expect(shows(0, 0)).toBeNull();
    stage.grab(false);
    expect(shows(0, 0)).toBeNull();
    expect(shows(0, 0.4)).toBeNull();
    expect(shows(0, 0.6)).toBe('own');
    stage.grab(true);
    expect(stage.followed).toBeNull();
  });

  test('is left alone while it follows a character anyway', () => {
    stage.followed = 'other';
    stage.places.set('own', [90, 0]);
    finder.frame('own', true);
    expect(stage.followed).toBe('other');
  });

  test('finds the character on request, and comes near', () => {
    shows(0, 0);
    stage.camera = [80, 0, 0, 0.5, 1, 40];
    finder.find('own');
    expect(stage.camera).toEqual([0, 0.9, 0, 0.5, 1, 8]);
    finder.find('nothing');
    expect(stage.camera[0]).toBe(0);
  });
});
