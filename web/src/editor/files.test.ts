import { describe, expect, it } from 'vitest';
import { readBvh, writeBvh } from './bvh';
import { headingOf, poseAt, resample } from './clip';
import { readCsv, writeCsv } from './csv';
import { formatOf } from './files';
import { readGlb, writeGlb } from './glb';
import { onSkeleton } from './recording';
import { example, exampleText, farthest, farthestTurn, rigFor, robot, WALK_PARENTS } from './testing';

/** What three's exporter needs of a browser. */
class Reader {
  result: ArrayBuffer | undefined;
  onloadend: (() => void) | undefined;

  readAsArrayBuffer(blob: Blob): void {
    void blob.arrayBuffer().then((buffer) => {
      this.result = buffer;
      this.onloadend?.();
    });
  }
}

describe('BVH', () => {
  it('reads the example in metres', () => {
    const { rig, clip } = example();
    expect(clip.frames).toBe(120);
    expect(clip.fps).toBe(30);
    expect(rig.skeleton.names).toHaveLength(21);
    // The root's place comes first in each row, in centimetres.
    const rows = exampleText()
      .split(/Frame Time.*\n/)[1]!
      .trim()
      .split('\n');
    [0, 60, 119].forEach((frame) => {
      const centimetres = rows[frame]!.split(' ').slice(0, 3).map(Number);
      expect(
        farthest(
          poseAt(clip, frame).root,
          centimetres.map((value) => value / 100),
        ),
      ).toBeLessThan(1e-6);
    });
    // It begins facing ahead, about, and bears to the left.
    expect(Math.abs(headingOf(poseAt(clip, 0), rig.leftAxis))).toBeLessThan(0.1);
    expect(headingOf(poseAt(clip, 119), rig.leftAxis)).toBeGreaterThan(0.3);
  });

  it('comes back from a file of its own', () => {
    const { rig, clip } = example();
    const again = onSkeleton(readBvh(writeBvh(clip, rig), 'again.bvh'), rig, 'again.bvh');
    expect(farthest(again.roots, clip.roots)).toBeLessThan(1e-6);
    expect(farthestTurn(again.rotations, clip.rotations)).toBeLessThan(2e-3);
  });

  it('writes the hierarchy of the example again', () => {
    const { rig, clip } = example();
    const hierarchy = (text: string) => text.slice(0, text.indexOf('MOTION')).split(/\s+/);
    const [ours, theirs] = [hierarchy(writeBvh(clip, rig)), hierarchy(exampleText())];
    expect(ours.filter((word) => !/^-?\d/.test(word))).toEqual(theirs.filter((word) => !/^-?\d/.test(word)));
    const numbers = (words: string[]) => words.filter((word) => /^-?\d/.test(word)).map(Number);
    expect(farthest(numbers(ours), numbers(theirs))).toBeLessThan(1e-3);
  });

  it('takes position channels for offsets, and folds joints that the skeleton lacks', () => {
    const text = `HIERARCHY ROOT place { OFFSET 0 0 0 CHANNELS 3 Zrotation Xrotation Yrotation
      JOINT a { OFFSET 9 9 9 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
      JOINT b { OFFSET 0 50 0 CHANNELS 0 End Site { OFFSET 0 1 0 } } } }
      MOTION Frames: 1 Frame Time: 0.0333333
      0 0 90 100 90 0 0 0 0`;
    const read = readBvh(text, 'placed.bvh');
    expect(read.fps).toBe(30);
    const rig = rigFor(
      { ...read, names: ['a', 'b'], places: read.places.slice(3), turns: read.turns.slice(4) },
      [-1, 0],
    );
    const clip = onSkeleton(read, rig, 'placed.bvh');
    // Turned by 90° about Y, +X is -Z.
    expect(farthest(clip.roots, [0, 0.9, -1])).toBeLessThan(1e-6);
  });

  it('names the joints that a clip lacks', () => {
    const { rig } = example();
    const text = exampleText().replace('Toes_L', 'toe.l').replace('Head', 'Skull');
    expect(() => onSkeleton(readBvh(text, 'other.bvh'), rig, 'other.bvh')).toThrow(
      'other.bvh: lacks 2 of the 21 joints of pack human: Head, Toes_L',
    );
  });

  it('names the bone that has another length', () => {
    const { rig } = example();
    const text = exampleText().replace('OFFSET 39.0811 0 0', 'OFFSET 45 0 0');
    expect(() => onSkeleton(readBvh(text, 'long.bvh'), rig, 'long.bvh')).toThrow(/LowerLeg_L stands 0\.059 m/);
  });

  it('says what is wrong with a file', () => {
    expect(() => readBvh('HIERARCHY ROOT a { OFFSET 0 0', 'cut.bvh')).toThrow('cut.bvh: ends before it is complete');
    const high = exampleText().replace(/(Frame Time: \S+\n\S+) \S+/, '$1 high');
    expect(() => readBvh(high, 'x.bvh')).toThrow('frame 0, joint Hips is "high"');
    expect(() => readBvh(exampleText().replace('Frames: 120', 'Frames: 119'), 'x.bvh')).toThrow('after its 119 frames');
    expect(() => formatOf('walk.fbx')).toThrow('neither BVH, glb nor CSV');
  });

  it('has the parents that the tests say', () => {
    const { skeleton } = example().rig;
    expect(skeleton.names[WALK_PARENTS[skeleton.names.indexOf('Toes_R')]!]).toBe('Foot_R');
    expect(skeleton.names[WALK_PARENTS[skeleton.names.indexOf('UpperArm_R')]!]).toBe('Shoulder_R');
  });
});

describe('glb', () => {
  it('comes back from a file of its own', async () => {
    Object.assign(globalThis, { FileReader: Reader });
    const { rig, clip } = example();
    const read = await readGlb(await writeGlb(clip, rig), rig.fps, 'again.glb');
    const again = onSkeleton(read, rig, 'again.glb');
    expect(again.frames).toBe(clip.frames);
    expect(farthest(again.roots, clip.roots)).toBeLessThan(1e-5);
    expect(farthestTurn(again.rotations, clip.rotations)).toBeLessThan(2e-3);
  });

  it('says what it is not', async () => {
    await expect(readGlb(new ArrayBuffer(8), 30, 'bad.glb')).rejects.toThrow('bad.glb: is not a glb that can be read');
  });
});

describe('CSV', () => {
  const row = '1.5,0.5,0.8,0,0,0.7071068,0.7071068,0.1,0.2,-0.3,1.1,-0.4,0.05';

  it('reads ROS axes and angles, and writes them again', () => {
    const rig = robot();
    const clip = readCsv(`${row}\n\n${row}\n`, rig, 'walk.csv');
    expect(clip.frames).toBe(2);
    expect(farthest(poseAt(clip, 1).root, [0.5, 0.8, 1.5])).toBeLessThan(1e-6);
    // Turned to the left by a quarter: along +X.
    expect(headingOf(poseAt(clip, 0), rig.leftAxis)).toBeCloseTo(Math.PI / 2, 5);
    const numbers = writeCsv(clip, rig).split('\n')[0]!.split(',').map(Number);
    expect(farthest(numbers, row.split(',').map(Number))).toBeLessThan(2e-6);
  });

  it('names line and column', () => {
    const rig = robot();
    expect(() => readCsv(`${row}\n1,2\n`, rig, 'a.csv')).toThrow(
      'a.csv, line 2: 2 columns; the robot of pack g1 has 13: 7 of the root and 6 angles',
    );
    expect(() => readCsv(row.replace('1.1', 'x'), rig, 'a.csv')).toThrow(
      'a.csv, line 1, column 11: "x" is no finite number',
    );
    expect(() => readCsv(row.replaceAll('0.7071068', '0.9'), rig, 'a.csv')).toThrow(
      'columns 4 to 7, has length 1.2728',
    );
    expect(() => readCsv(row, example().rig, 'a.csv')).toThrow('pack human has no robot');
  });
});

it('a clip at another rate keeps its places in time', () => {
  const { clip } = example();
  const fast = resample(clip, 60);
  expect(fast.frames).toBe(239);
  expect(farthest(poseAt(fast, 40).root, poseAt(clip, 20).root)).toBeLessThan(1e-6);
  expect(farthestTurn(poseAt(resample(fast, 30), 31).rotations, poseAt(clip, 31).rotations)).toBeLessThan(2e-3);
});
