// A robot: slender pale links between dark joints, a trunk, and a head with nothing human about it.
import { beyond, type Capsule, type End, type Rig, type Tree } from './rig';

const LINK = 0.3;
const JOINT = -0.45;
/** Links shorter than this share of the body lie inside a motor. */
const SHORT = 0.05;

export function buildRobot(tree: Tree): Omit<Rig, 'kind'> {
  const { skeleton, lengths, below, tips, children } = tree;
  const size = below[0]! / 0.75;
  const capsules: Capsule[] = [];
  const add = (from: End, to: End, a: number, b: number, shade: number): void => {
    capsules.push({ from, to, radii: [a * size, b * size], shade });
  };
  const radius = (joint: number): number => Math.min(0.03 + 0.04 * (below[joint]! / size), 0.062);
  const isTrunk = (joint: number): boolean => joint === 0 || tips[joint]! > 1;

  const shoulders: number[] = [];
  let chest = 0;
  for (let j = 1; j < tree.count; j++) {
    const parent = skeleton.parents[j]!;
    const name = skeleton.names[j]!;
    if (isTrunk(j)) {
      add({ joint: parent }, { joint: j }, 0.075, 0.085, LINK);
      chest = j;
      continue;
    }
    const r = radius(j);
    const isLong = lengths[j]! > SHORT * size;
    add({ joint: parent }, { joint: j }, isLong ? r : r * 0.9, isLong ? r * 0.85 : r * 0.9, isLong ? LINK : JOINT);
    // A motor at either end of a long link.
    if (isLong && children[j]!.length > 0) add({ joint: j }, { joint: j }, r * 1.12, r * 1.12, JOINT);
    if (isTrunk(parent) && parent !== 0) shoulders.push(j);
    if (children[j]!.length === 0 && !/toe/i.test(name))
      add({ joint: j }, { joint: j, local: beyond(tree, j, 0.06 * size) }, r * 0.9, r * 0.75, JOINT);
    if (/toe/i.test(name)) addFoot(tree, j, add);
  }

  // The pelvis, and a chest between the arms.
  const hips = children[0]!.filter((joint) => !isTrunk(joint));
  hips.slice(1).forEach((joint) => {
    add({ joint: hips[0]! }, { joint }, 0.062, 0.062, JOINT);
  });
  const [left, right] = shoulders;
  if (left !== undefined && right !== undefined) {
    const parent = skeleton.parents[left]!;
    const [a, b] = [offsetOf(tree, left), offsetOf(tree, right)];
    const middle = (share: number, up: number): End => ({
      joint: parent,
      local: [
        (a[0] + b[0]) / 2 + (share * (a[0] - b[0])) / 2,
        ((a[1] + b[1]) / 2) * up + (share * (a[1] - b[1])) / 2,
        ((a[2] + b[2]) / 2) * up + (share * (a[2] - b[2])) / 2,
      ],
    });
    for (const share of [0.6, -0.6]) add({ joint: chest }, middle(share, 0.98), 0.075, 0.078, LINK);
    add(middle(0.6, 0.7), middle(-0.6, 0.7), 0.085, 0.085, LINK);
    add(middle(0.9, 1), middle(-0.9, 1), 0.058, 0.058, JOINT);
    if (!skeleton.names.some((name) => /head/i.test(name))) {
      add(middle(0, 1.15), middle(0, 1.5), 0.045, 0.045, JOINT);
      add(middle(0, 1.62), middle(0, 1.9), 0.072, 0.068, LINK);
    }
  }
  return { capsules, footprint_m: 0.32 * size };
}

/** A flat sole from behind the ankle to the toe. */
function addFoot(
  tree: Tree,
  toe: number,
  add: (from: End, to: End, a: number, b: number, shade: number) => void,
): void {
  const ankle = tree.skeleton.parents[toe]!;
  const [x, y, z] = offsetOf(tree, toe);
  const back: End = { joint: ankle, local: [-0.45 * x, y, -0.45 * z] };
  add({ joint: ankle }, back, 0.034, 0.026, JOINT);
  add(back, { joint: toe }, 0.026, 0.026, JOINT);
  add({ joint: ankle }, { joint: toe }, 0.036, 0.026, JOINT);
}

function offsetOf(tree: Tree, joint: number): [number, number, number] {
  const o = joint * 3;
  return [tree.skeleton.offsets[o]!, tree.skeleton.offsets[o + 1]!, tree.skeleton.offsets[o + 2]!];
}
