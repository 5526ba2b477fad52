import { beforeAll, describe, expect, it } from 'vitest';
import { Joints } from '../stage/kinematics';
import { HERO_BONES, heroGlb } from '../retarget/testing';
import { loadReader } from '../retarget/reader';
import type { Source } from '../retarget/source';
import { headingOf, jointsOf, poseAt, slice } from './clip';
import { carried, dressed, openOwn, ownVariant, packDoc, type OwnClip } from './own';
import { tablesOf, understandOwn } from './reading';
import { fillRequest } from './request';
import { newDoc, withTarget, type Doc } from './segment';
import { example, farthest, farthestTurn } from './testing';

const { rig: pack, clip: walk } = example();
let opened: OwnClip;
let doc: Doc;

beforeAll(async () => {
  const reader = await loadReader();
  const body = reader.body_of_pack(JSON.stringify(tablesOf(pack)), walk.fps, walk.roots, walk.rotations);
  const source: Source = { body, motion: walk, ground_m: 0 };
  opened = await openOwn('hero.glb', heroGlb(), pack, source, {});
  doc = withTarget(newDoc(carried(opened.own.back, walk), opened.own.rig, 'hero.glb'), pack.limits);
});

describe('a rig of the user’s own', () => {
  it('is found and certified', () => {
    const { own, clip } = opened;
    expect(clip).toBeUndefined();
    expect(own.rig.skeleton.names).toHaveLength(HERO_BONES);
    expect(own.back.scale).toBeGreaterThan(1.2);
    expect(own.back.scale * own.there.scale).toBeCloseTo(1, 4);
    expect(own.certificate.trials.map(({ name }) => name)).toContain('walk');
    expect(own.certificate.faults).toEqual([]);
  });

  it('walks as the pack does, in its own size', () => {
    const { own } = opened;
    const { clip } = doc;
    expect(jointsOf(clip)).toBe(HERO_BONES);
    const [first, last] = [poseAt(clip, 0), poseAt(clip, 119)];
    const way = (of: typeof walk) =>
      Math.hypot(of.roots[119 * 3]! - of.roots[0]!, of.roots[119 * 3 + 2]! - of.roots[2]!);
    expect(way(clip) / way(walk)).toBeCloseTo(own.back.scale, 1);
    const turned = headingOf(last, own.rig.leftAxis) - headingOf(first, own.rig.leftAxis);
    expect(turned).toBeCloseTo(
      headingOf(poseAt(walk, 119), pack.leftAxis) - headingOf(poseAt(walk, 0), pack.leftAxis),
      1,
    );
    // No foot is far under the ground, and one is always near it.
    const joints = new Joints(own.rig.skeleton);
    const toes = own.rig.skeleton.names.flatMap((name, j) => (name.endsWith('ToeBase') ? [j] : []));
    for (let f = 0; f < clip.frames; f++) {
      joints.update(poseAt(clip, f));
      const lowest = Math.min(...toes.map((toe) => joints.positions[toe * 3 + 1]!));
      expect(lowest).toBeGreaterThan(0);
      expect(lowest).toBeLessThan(0.12);
    }
  });

  it('asks on the pack’s body, and its keyframes hold bit for bit', () => {
    const { own } = opened;
    const edited = { root: Float32Array.from(poseAt(doc.clip, doc.gap.end).root), rotations: new Float32Array(0) };
    edited.root[1]! -= 0.1;
    edited.rotations = Float32Array.from(poseAt(doc.clip, doc.gap.end).rotations);
    const posed = { ...doc, targets: [doc.targets[0]!, { ...doc.targets[1]!, edited }] };
    const asked = packDoc(own, posed);
    expect(asked.gap).toEqual({ start: 0, end: 39 });
    expect(jointsOf(asked.clip)).toBe(21);
    expect(asked.clip.frames).toBe(40);
    const request = fillRequest(pack, asked, {
      seeds: [1],
      temperature: 0,
      poseSteps: 1,
      holdFeet: true,
      modelsLength: false,
    });
    expect(request.characters[0]!.context).toHaveLength(4);
    expect(request.characters[0]!.targets[1]!.pose!.rotations).toHaveLength(21 * 4);
    // What the pack's body is asked for is what it does itself.
    const captured = slice(walk, doc.gap.start, doc.gap.end + 1);
    expect(farthest(asked.clip.roots.subarray(0, 38 * 3), captured.roots.subarray(0, 38 * 3))).toBeLessThan(0.03);

    const variant = ownVariant(own, posed, { seed: 1, clip: captured, contacts: [] });
    const exact = (frame: number, of: { root: Float32Array; rotations: Float32Array }) => {
      expect(Array.from(poseAt(variant.clip, frame).root)).toEqual(Array.from(of.root));
      expect(Array.from(poseAt(variant.clip, frame).rotations)).toEqual(Array.from(of.rotations));
    };
    for (let c = 0; c < 4; c++) exact(c, poseAt(doc.clip, doc.gap.start + c));
    exact(38, poseAt(doc.clip, doc.gap.end - 1));
    exact(39, edited);
    // It leads there without a leap.
    for (let f = 1; f < 38; f++) {
      const [before, now] = [poseAt(variant.clip, f - 1), poseAt(variant.clip, f)];
      expect(farthest(before.root, now.root)).toBeLessThan(0.08);
      expect(farthestTurn(before.rotations, now.rotations)).toBeLessThan(0.35);
    }
  });

  it('leaves to the server what a keyframe does not give', () => {
    const { own } = opened;
    const free = { ...doc, targets: [{ givesRoot: false, givesPose: true }] };
    const captured = slice(walk, doc.gap.start, doc.gap.end + 1);
    // The server ends elsewhere.
    for (let f = 4; f < 40; f++) captured.roots[f * 3]! += 0.01 * (f - 3);
    const { clip } = ownVariant(own, free, { seed: 1, clip: captured, contacts: [] });
    const [made, wanted, raw] = [clip, doc.clip, carried(own.back, captured)].map((of, i) =>
      poseAt(of, i === 1 ? doc.gap.end : 39),
    ) as [ReturnType<typeof poseAt>, ReturnType<typeof poseAt>, ReturnType<typeof poseAt>];
    expect([made.root[0], made.root[2]]).toEqual([raw.root[0], raw.root[2]]);
    expect(made.root[1]).toBe(wanted.root[1]);
    expect(Array.from(made.rotations.subarray(4))).toEqual(Array.from(wanted.rotations.subarray(4)));
  });

  it('is written with its mesh', async () => {
    const blob = dressed(opened.own, doc.clip, 'walk')!;
    const bytes = new Uint8Array(await blob.arrayBuffer());
    const again = await understandOwn('hero-walk.glb', bytes, pack);
    expect(again.animations).toEqual(['walk']);
    expect(again.clip!.frames).toBe(doc.clip.frames);
    expect(farthestTurn(again.clip!.rotations, doc.clip.rotations)).toBeLessThan(2e-3);
    expect(new TextDecoder().decode(bytes)).toContain('JOINTS_0');
  });
});
