// Any other body: a trunk where limbs meet, limbs that taper to their ends, a head, and thin tails
// and ears.
import { beyond, type Capsule, type Rig, type Tree } from './rig';

/** Radii by the size of the body: the longest way from its root to an end. */
const TRUNK = 0.082;
const TIP = 0.013;
const HEAD = 0.052;
/** How fast a limb grows towards the trunk. */
const GROWTH = 0.062;
const THIN = /tail|ear|mouth|jaw|leaf|finger|claw|antenna|horn|tongue|wing|fin|feather/i;
const HEADS = /head|skull/i;

export function buildAnimal(tree: Tree): Omit<Rig, 'kind'> {
  const { skeleton, below, tips, children, lengths } = tree;
  const size = Math.max(below[0]!, 0.2);
  const head = skeleton.names.findIndex((name) => HEADS.test(name));
  const isUnderHead = isBelow(tree, head);
  const leadsToHead = new Array<boolean>(tree.count).fill(false);
  for (let j = head; j >= 0; j = skeleton.parents[j]!) leadsToHead[j] = true;
  // A trunk carries limbs: ends that hang low enough to be more than an ear or a rib.
  const limbs = new Array<number>(tree.count).fill(0);
  for (let j = tree.count - 1; j > 0; j--) {
    const isLimb = !isUnderHead[j] && !leadsToHead[j] && below[j]! + lengths[j]! > 0.2 * size && tips[j]! < 4;
    const parent = skeleton.parents[j]!;
    limbs[parent]! += Math.max(limbs[j]!, isLimb && !THIN.test(skeleton.names[j]!) ? 1 : 0);
  }
  const radiusOf = (j: number): number => {
    if (j === head) return HEAD * size;
    if (isUnderHead[j]) return (THIN.test(skeleton.names[j]!) ? 0.4 : 0.62) * HEAD * size;
    if (THIN.test(skeleton.names[j]!)) return Math.min(TIP * size + 0.03 * below[j]!, 0.024 * size);
    if (j === 0 || limbs[j]! > 1) return TRUNK * size;
    const grown = TIP * size + GROWTH * below[j]!;
    if (leadsToHead[j]) return Math.max(0.055 * size, Math.min(grown, TRUNK * size));
    return Math.min(grown, TRUNK * 0.8 * size);
  };
  const radii = Array.from({ length: tree.count }, (_, j) => radiusOf(j));

  const capsules: Capsule[] = [];
  for (let j = 1; j < tree.count; j++) {
    const parent = skeleton.parents[j]!;
    if (lengths[j]! < 1e-4) continue;
    // A limb leaves the trunk with its own thickness, a thin part with its own.
    const isThin = THIN.test(skeleton.names[j]!) || (isUnderHead[j] ?? false);
    const start = isThin ? radii[j]! * 1.15 : Math.min(radii[parent]!, radii[j]! * 1.9);
    const shade = isUnderHead[j] || j === head ? 0.08 : tips[j]! > 1 ? 0 : -0.06;
    capsules.push({ from: { joint: parent }, to: { joint: j }, radii: [start, radii[j]!], shade });
    if (children[j]!.length > 0 || isUnderHead[j]) continue;
    const cap = Math.min(0.04 * size, radii[j]! * 1.2);
    const to = { joint: j, local: beyond(tree, j, cap) };
    capsules.push({ from: { joint: j }, to, radii: [radii[j]!, radii[j]! * 0.8], shade: -0.3 });
  }
  if (head >= 0 && children[head]!.length === 0) {
    const to = { joint: head, local: beyond(tree, head, HEAD * size) };
    capsules.push({ from: { joint: head }, to, radii: [HEAD * size, HEAD * 0.8 * size], shade: 0.08 });
  }
  return { capsules, footprint_m: 0.3 * size };
}

function isBelow(tree: Tree, top: number): boolean[] {
  const found = new Array<boolean>(tree.count).fill(false);
  if (top < 0) return found;
  for (let j = top + 1; j < tree.count; j++) {
    const parent = tree.skeleton.parents[j]!;
    found[j] = parent === top || (found[parent] ?? false);
  }
  return found;
}
