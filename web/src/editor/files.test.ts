import { describe, expect, it } from 'vitest';
import { writeBvh } from './bvh';
import { headingOf, poseAt, resample } from './clip';
import { writeCsv } from './csv';
import { writeGlb } from './glb';
import { understand } from './reading';
import { example, exampleText, farthest, farthestTurn, robot, WALK_PARENTS } from './testing';

const bytes = (text: string) => new TextEncoder().encode(text);

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

  it('comes back from a file of its own', async () => {
    const { rig, clip } = example();
    const { clip: again } = await understand('again.bvh', bytes(writeBvh(clip, rig)), rig);
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

  it('names the joints that a clip lacks', async () => {
    const { rig } = example();
    const text = exampleText().replace('Toes_L', 'toe.l').replace('Head', 'Skull');
    await expect(understand('other.bvh', bytes(text), rig)).rejects.toThrow(/other\.bvh: .*(Head|Toes_L)/);
  });

  it('names the bone that has another length', async () => {
    const { rig } = example();
    const text = exampleText().replace('OFFSET 39.0811 0 0', 'OFFSET 45 0 0');
    await expect(understand('long.bvh', bytes(text), rig)).rejects.toThrow(
      /long\.bvh: .*LowerLeg_L.*--other-bones .*\(options of troupe clip convert\)/,
    );
  });

  it('says what is wrong with a file', async () => {
    const { rig } = example();
    const refused = (text: string, name = 'x.bvh') => expect(understand(name, bytes(text), rig)).rejects;
    await refused('HIERARCHY ROOT a { OFFSET 0 0', 'cut.bvh').toThrow(/cut\.bvh: line 1: /);
    await refused(exampleText().replace(/(Frame Time: \S+\n\S+) \S+/, '$1 high')).toThrow(
      'expected a number, found "high"',
    );
    await refused(exampleText().replace('Frames: 120', 'Frames: 110')).toThrow('110 frames are declared');
    await refused('; FBX 7.4.0 project file', 'walk.fbx').toThrow('FBX is not read');
  });

  it('says what it understood', async () => {
    const { rig } = example();
    const { rows } = await understand('walk.bvh', bytes(exampleText()), rig);
    expect(rows[0]!.slice(0, 2)).toEqual(['format', 'BVH']);
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
    const written = new Uint8Array(await writeGlb(clip, rig));
    const { clip: again } = await understand('again.glb', written, rig);
    expect(again.frames).toBe(clip.frames);
    expect(farthest(again.roots, clip.roots)).toBeLessThan(1e-5);
    expect(farthestTurn(again.rotations, clip.rotations)).toBeLessThan(2e-3);
  });

  it('says what it is not', async () => {
    await expect(understand('bad.glb', new Uint8Array(8), example().rig)).rejects.toThrow(/glTF|glb/);
  });
});

describe('CSV', () => {
  const row = '1.5,0.5,0.8,0,0,0.7071068,0.7071068,0.1,0.2,-0.3,1.1,-0.4,0.05';

  it('reads ROS axes and angles, and writes them again', async () => {
    const rig = robot();
    const { clip } = await understand('walk.csv', bytes(`${row}\n\n${row}\n`), rig);
    expect(clip.frames).toBe(2);
    expect(farthest(poseAt(clip, 1).root, [0.5, 0.8, 1.5])).toBeLessThan(1e-6);
    // Turned to the left by a quarter: along +X.
    expect(headingOf(poseAt(clip, 0), rig.leftAxis)).toBeCloseTo(Math.PI / 2, 5);
    const numbers = writeCsv(clip, rig).split('\n')[0]!.split(',').map(Number);
    expect(farthest(numbers, row.split(',').map(Number))).toBeLessThan(2e-6);
  });

  it('names line and column', async () => {
    const rig = robot();
    const refused = (text: string, of = rig) => expect(understand('a.csv', bytes(text), of)).rejects;
    await refused(`${row}\n1,2\n`).toThrow('a.csv: line 2: 2 columns; the first row has 13');
    await refused('1,2\n').toThrow('a.csv: 2 columns; robot g1 has 13: 7 of the root and 6 angles');
    await refused(row.replace('1.1', 'x')).toThrow('a.csv: line 1, column 11: "x" is no finite number');
    await refused(row.replaceAll('0.7071068', '0.9')).toThrow("the length of the root's quaternion is 1.273");
    await refused(row, example().rig).toThrow('a.csv: ');
  });
});

it('a clip at another rate keeps its places in time', () => {
  const { clip } = example();
  const fast = resample(clip, 60);
  expect(fast.frames).toBe(239);
  expect(farthest(poseAt(fast, 40).root, poseAt(clip, 20).root)).toBeLessThan(1e-6);
  expect(farthestTurn(poseAt(resample(fast, 30), 31).rotations, poseAt(clip, 31).rotations)).toBeLessThan(2e-3);
});
