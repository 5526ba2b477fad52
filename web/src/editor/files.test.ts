import { describe, expect, it } from 'vitest';
import { writeBvh } from './bvh';
import { headingOf, poseAt, resample, type Rig } from './clip';
import { writeCsv } from './csv';
import { writeGlb } from './glb';
import { Misread, optionsFor, understand, type Given } from './reading';
import { example, exampleText, farthest, farthestTurn, robot, WALK_PARENTS } from './testing';

const bytes = (text: string) => new TextEncoder().encode(text);

/** The options that the reader's error names. */
async function refusal(name: string, file: Uint8Array, rig: Rig, given: Given = {}) {
  const error: unknown = await understand(name, file, rig, given).catch((why: unknown) => why);
  expect(error).toBeInstanceOf(Misread);
  return (error as Misread).options;
}

/** A glb with a copy of its animation for each name. */
function withAnimations(glb: Uint8Array, names: readonly string[]): Uint8Array {
  const view = new DataView(glb.buffer, glb.byteOffset);
  const end = 20 + view.getUint32(12, true);
  const json = JSON.parse(new TextDecoder().decode(glb.subarray(20, end))) as { animations: object[] };
  const animations = names.map((name) => ({ ...json.animations[0], name }));
  let text = JSON.stringify({ ...json, animations });
  text += ' '.repeat((4 - (text.length % 4)) % 4);
  const made = new Uint8Array(20 + text.length + glb.length - end);
  made.set(glb.subarray(0, 20));
  made.set(bytes(text), 20);
  made.set(glb.subarray(end), 20 + text.length);
  new DataView(made.buffer).setUint32(8, made.length, true);
  new DataView(made.buffer).setUint32(12, text.length, true);
  return made;
}

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
    await expect(understand('long.bvh', bytes(text), rig)).rejects.toThrow(/long\.bvh: .*LowerLeg_L.*--other-bones /);
  });

  it('is read as an option says that the error names', async () => {
    const { rig, clip } = example();
    const long = bytes(exampleText().replace('OFFSET 39.0811 0 0', 'OFFSET 45 0 0'));
    const asked = await refusal('long.bvh', long, rig);
    expect(asked.map(({ option }) => option)).toEqual(['unit', 'other_bones']);
    const read = await understand('long.bvh', long, rig, { other_bones: 'true' });
    expect(farthestTurn(read.clip.rotations, clip.rotations)).toBeLessThan(2e-3);

    const still = bytes(exampleText().replace(/Frame Time: \S+/, 'Frame Time: 0'));
    expect(await refusal('still.bvh', still, rig)).toEqual([{ option: 'fps', values: [] }]);
    const { clip: slow } = await understand('still.bvh', still, rig, { fps: '15', unit: undefined });
    expect(slow.frames).toBe(239);
    await expect(understand('still.bvh', still, rig, { fps: 'slow' })).rejects.toThrow(
      'fps is "slow"; allowed: a number',
    );
  });

  it('lies down if it is read with another up axis', async () => {
    const { rig } = example();
    const { rows, clip } = await understand('walk.bvh', bytes(exampleText()), rig, { up: 'z' });
    expect(rows).toContainEqual(['up axis', 'z', '--up']);
    expect(poseAt(clip, 0).root[1]).toBeLessThan(0.5);
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

  it('is read with the animation that is chosen', async () => {
    const { rig, clip } = example();
    const two = withAnimations(new Uint8Array(await writeGlb(clip, rig)), ['Walk', 'Stroll']);
    const { animations } = await understand('two.glb', two, rig);
    expect(animations).toEqual(['Walk', 'Stroll']);
    const { clip: stroll } = await understand('two.glb', two, rig, { animation: 'Stroll' });
    expect(stroll.frames).toBe(clip.frames);
    expect(await refusal('two.glb', two, rig, { animation: 'Run' })).toEqual([
      { option: 'animation', values: ['Walk', 'Stroll'] },
    ]);
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

  it('has options of its own', async () => {
    const names = async (rig: Rig) => (await optionsFor(rig)).map(({ name }) => name);
    expect(await names(robot())).toEqual(expect.arrayContaining(['quaternion', 'degrees', 'joint_order', 'fps']));
    expect(await names(example().rig)).not.toContain('quaternion');
    const given = { quaternion: 'xyzw', degrees: 'true', joint_order: 'tree' };
    const { clip } = await understand('walk.csv', bytes(`${row}\n${row}\n`), robot(), given);
    const numbers = writeCsv(clip, robot()).split('\n')[0]!.split(',').map(Number);
    expect(numbers[10]).toBeCloseTo((1.1 * Math.PI) / 180, 5);
    // 5.9 of either unit, or in another order.
    const bent = bytes(row.replace('1.1', '5.9'));
    expect(await refusal('bent.csv', bent, robot())).toEqual([
      { option: 'joint_order', values: [] },
      { option: 'degrees', values: ['true'] },
    ]);
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
