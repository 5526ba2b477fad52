import { expect, test } from 'vitest';
import { poseAt, resample } from '../editor/clip';
import { tablesOf } from '../editor/reading';
import { example, farthest, farthestTurn } from '../editor/testing';
import { WasmCarrier } from './carrier';
import { fitHero, readHero } from './character';
import { COLUMNS } from './certificate';
import { loadReader } from './reader';
import type { Source } from './source';
import { HERO_BONES, heroGlb } from './testing';

const { rig, clip } = example();

async function source(): Promise<Source> {
  const reader = await loadReader();
  const body = reader.body_of_pack(JSON.stringify(tablesOf(rig)), clip.fps, clip.roots, clip.rotations);
  return { body, motion: clip, ground_m: 0 };
}

test('members of a crowd are carried as clips are, each with a state of its own', async () => {
  const hero = await readHero('hero.glb', heroGlb());
  expect(hero.skeleton.names).toHaveLength(HERO_BONES);
  const { retargeter } = await fitHero(await source(), hero);
  const whole = retargeter.carry(clip.fps, clip.roots, clip.rotations);
  const wanted = { fps: 30, frames: clip.frames, roots: whole.roots, rotations: whole.rotations };
  const carrier = new WasmCarrier(retargeter, hero.skeleton, rig.skeleton.names.length, 0);
  carrier.grow(2);
  for (let f = 0; f < 60; f++) {
    for (const [member, frame] of [f, f + 40].entries()) {
      if (member === 1 && f >= 20) continue;
      const { root, rotations } = poseAt(clip, frame);
      carrier.put(member, root, rotations);
    }
    // Memory that grows and room for more members change nothing.
    if (f === 10) (await readHero('other.glb', heroGlb(2))).body.parts();
    if (f === 30) carrier.grow(300);
    carrier.carry(1 / clip.fps);
    const made = carrier.pose(0);
    expect(farthest(made.root, poseAt(wanted, f).root)).toBeLessThan(1e-6);
    expect(farthestTurn(made.rotations, poseAt(wanted, f).rotations)).toBeLessThan(1e-4);
  }
  // The other one keeps its last pose.
  expect(farthest(carrier.pose(1).root, poseAt(wanted, 59).root)).toBeLessThan(0.02);
  carrier.reset(0);
  const { root, rotations } = poseAt(clip, 0);
  carrier.put(0, root, rotations);
  carrier.carry(1 / clip.fps);
  expect(farthestTurn(carrier.pose(0).rotations, poseAt(wanted, 0).rotations)).toBeLessThan(1e-4);
  carrier.dispose();
});

test('feet turn as fast at every rate of the screen', async () => {
  const hero = await readHero('hero.glb', heroGlb());
  const { retargeter } = await fitHero(await source(), hero);
  const [fast, faster] = [120, 240].map((fps) => resample(clip, fps)) as [typeof clip, typeof clip];
  const { roots, rotations } = retargeter.carry(fast.fps, fast.roots, fast.rotations);
  const wanted = { fps: fast.fps, frames: fast.frames, roots, rotations };
  /** Sum of the largest turns between poses at 120 Hz and those of a screen with 240 pictures a second. */
  const apart = (picture_s: number): number => {
    const carrier = new WasmCarrier(retargeter, hero.skeleton, rig.skeleton.names.length, 0);
    carrier.grow(1);
    let sum = 0;
    for (let f = 0; f < faster.frames; f++) {
      const pose = poseAt(faster, f);
      carrier.put(0, pose.root, pose.rotations);
      carrier.carry(picture_s);
      if (f % 2 === 0) sum += farthestTurn(carrier.pose(0).rotations, poseAt(wanted, f / 2).rotations);
    }
    carrier.dispose();
    return sum;
  };
  // With pictures that are said to be twice as long as they are, feet turn too fast.
  expect(apart(1 / faster.fps)).toBeLessThan(0.5 * apart(1 / fast.fps));
  expect(() => retargeter.carry(0, clip.roots, clip.rotations)).toThrow('fps is 0; allowed: above 0');
  // A member without a new pose waits, and its time counts.
  const [waits, goes] = [0, 1].map((wait) => {
    const carrier = new WasmCarrier(retargeter, hero.skeleton, rig.skeleton.names.length, 0);
    carrier.grow(1);
    for (let f = 0; f < 60; f++) {
      const pose = poseAt(clip, f);
      if (wait === 0) carrier.carry(0.5 / clip.fps);
      carrier.put(0, pose.root, pose.rotations);
      carrier.carry((wait === 0 ? 0.5 : 1) / clip.fps);
    }
    const made = carrier.pose(0).rotations.slice();
    carrier.dispose();
    return made;
  });
  expect(farthestTurn(waits!, goes!)).toBeLessThan(1e-4);
});

test('a character has figures for each motion, and its parts as TOML', async () => {
  const hero = await readHero('hero.glb', heroGlb());
  const { certificate } = await fitHero(await source(), hero);
  expect(certificate.faults).toEqual([]);
  for (const { name, figures } of certificate.trials) {
    for (const { head, of } of COLUMNS) expect(of(figures), `${name}, ${head}`).toMatch(/^\d+\.\d/);
  }
  const parts = hero.body.parts();
  expect(parts).toContain('[left_arm]');
  expect(parts).toContain('"mixamorig:LeftForeArm"');
  // The figures show arms on the wrong sides.
  const other = { left: 'right', right: 'left' } as const;
  const wrong = parts.replace(/\[(left|right)_arm\]/g, (_, side: 'left' | 'right') => `[${other[side]}_arm]`);
  const fitted = await readHero('hero.glb', heroGlb(), wrong).then(async (one) => fitHero(await source(), one));
  expect(fitted.certificate.faults.join()).toMatch(/walk: .*mixamorig:/);
});

test('a vrm is read as a glb is', async () => {
  const { file, skeleton } = await readHero('hero.vrm', heroGlb());
  expect([file, skeleton.names.length]).toEqual(['hero.vrm', HERO_BONES]);
});

test('what cannot be carried over is refused with the file and the reason', async () => {
  await expect(readHero('broken.glb', heroGlb().subarray(0, 500))).rejects.toThrow('broken.glb');
  await expect(readHero('hero.glb', heroGlb(), 'trunk = 1')).rejects.toThrow(/hero\.glb: .*trunk/s);
  await expect(readHero('hero.glb', heroGlb(), 'trunk = ["Belly"]')).rejects.toThrow(/Belly/);
});
