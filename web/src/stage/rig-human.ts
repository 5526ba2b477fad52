// A person: shoulders, pelvis and a head that is rounder above than below.
import { partKey } from './names';
import { beyond, type Capsule, type End, type Rig, type Tree } from './rig';

/** Length of thigh and shank of the person for whom the radii below are. */
const LEG_M = 0.8;
const SKIN = 0.14;
const SHOE = -0.3;
const TROUSERS = -0.1;

export function buildHuman(tree: Tree): Omit<Rig, 'kind'> {
  const { names } = tree.skeleton;
  const index = new Map<string, number>();
  names.forEach((name, j) => {
    const key = partKey(name);
    if (!index.has(key)) index.set(key, j);
  });
  const at = (key: string): number => index.get(key) ?? 0;
  const size = (tree.lengths[at('lowerleg.l')]! + tree.lengths[at('foot.l')]!) / LEG_M;
  const capsules: Capsule[] = [];
  const add = (from: End, to: End, a: number, b: number, shade = 0): void => {
    capsules.push({ from, to, radii: [a * size, b * size], shade });
  };
  const bone = (from: string, to: string, a: number, b: number, shade = 0): void => {
    if (index.has(from) && index.has(to)) add({ joint: at(from) }, { joint: at(to) }, a, b, shade);
  };

  // Pelvis and trunk: along the spine, and from the waist to each shoulder.
  const spine = pathUp(tree, at('neck') || at('head'), at('hips'));
  const waist = spine[spine.length > 2 ? 1 : 0]!;
  bone('upperleg.l', 'upperleg.r', 0.092, 0.092, TROUSERS);
  for (let s = 1; s < spine.length; s++) {
    const isTop = s === spine.length - 1;
    add({ joint: spine[s - 1]! }, { joint: spine[s]! }, s === 1 ? 0.1 : 0.108, isTop ? 0.058 : 0.108);
  }
  bone('upperarm.l', 'upperarm.r', 0.062, 0.062);
  for (const side of ['l', 'r']) {
    add({ joint: waist }, { joint: at(`upperarm.${side}`) }, 0.098, 0.062);
    bone('hips', `upperleg.${side}`, 0.09, 0.088, TROUSERS);
  }

  // Neck and head: the skull's middle lies beyond the head's joint.
  const head = at('head');
  bone('neck', 'head', 0.052, 0.05, SKIN);
  const along = (metres: number): End => ({ joint: head, local: beyond(tree, head, metres * size) });
  add(along(0.045), along(0.115), 0.076, 0.098, SKIN);

  for (const side of ['l', 'r']) {
    bone(`upperarm.${side}`, `lowerarm.${side}`, 0.052, 0.041);
    bone(`lowerarm.${side}`, `hand.${side}`, 0.041, 0.03, SKIN);
    const hand = index.get(`hand.${side}`);
    if (hand !== undefined)
      add({ joint: hand }, { joint: hand, local: beyond(tree, hand, 0.11 * size) }, 0.033, 0.03, SKIN);
    bone(`upperleg.${side}`, `lowerleg.${side}`, 0.086, 0.056, TROUSERS);
    bone(`lowerleg.${side}`, `foot.${side}`, 0.056, 0.04, TROUSERS);
    const [foot, toes] = [at(`foot.${side}`), index.get(`toes.${side}`)];
    if (toes === undefined) {
      add({ joint: foot }, { joint: foot, local: beyond(tree, foot, 0.08 * size) }, 0.045, 0.04, SHOE);
      continue;
    }
    const heel: End = { joint: foot, heel: { knee: at(`lowerleg.${side}`), toes, length_m: 0.075 * size } };
    add({ joint: foot }, { joint: toes }, 0.046, 0.038, SHOE);
    add({ joint: foot }, heel, 0.044, 0.038, SHOE);
    add(heel, { joint: toes }, 0.036, 0.034, SHOE);
    add({ joint: toes }, { joint: toes, local: beyond(tree, toes, 0.055 * size) }, 0.037, 0.03, SHOE);
  }
  return { capsules, footprint_m: 0.34 * size };
}

/** Joints from `top` down to `bottom`, returned from below. */
function pathUp(tree: Tree, top: number, bottom: number): number[] {
  const path = [top];
  let joint = top;
  while (joint !== bottom && tree.skeleton.parents[joint]! >= 0) {
    joint = tree.skeleton.parents[joint]!;
    path.unshift(joint);
  }
  return path;
}
