// BVH: any hierarchy, any order of channels. Position channels replace the axis of the OFFSET that
// they name; rotation channels apply in the order in which they stand. Files are in centimetres
// (motion/src/bvh).
import { Euler, Quaternion, Vector3 } from 'three';
import type { Clip, Rig } from './clip';
import { poseAt, quaternionAt } from './clip';
import { checkLength, type Recording } from './recording';

const UNIT_M = 0.01;
const MOST_JOINTS = 1024;
const AXES = [new Vector3(1, 0, 0), new Vector3(0, 1, 0), new Vector3(0, 0, 1)] as const;
const CHANNEL = /^([xyz])(position|rotation)$/i;

interface Channel {
  axis: number;
  turns: boolean;
}

interface Node {
  name: string;
  parent: number;
  offset: [number, number, number];
  channels: Channel[];
}

/** The words of a text, and what is wrong with them. */
class Words {
  private readonly words: string[];
  private at = 0;

  constructor(
    text: string,
    readonly file: string,
  ) {
    this.words = text.split(/\s+/).filter((word) => word !== '');
  }

  get isAtEnd(): boolean {
    return this.at >= this.words.length;
  }

  next(): string {
    const word = this.words[this.at++];
    if (word === undefined) throw new Error(`${this.file}: ends before it is complete`);
    return word;
  }

  peek(): string {
    return this.words[this.at] ?? '';
  }

  expect(wanted: string): void {
    const word = this.next();
    if (word.toLowerCase() !== wanted.toLowerCase()) {
      throw new Error(`${this.file}: has "${word.slice(0, 32)}" where ${wanted} is expected`);
    }
  }

  number(what: string): number {
    const word = this.next();
    const value = Number(word);
    if (!Number.isFinite(value)) throw new Error(`${this.file}: ${what} is "${word.slice(0, 32)}", which is no number`);
    return value;
  }
}

function readHierarchy(words: Words): Node[] {
  const nodes: Node[] = [];
  const open: number[] = [];
  words.expect('HIERARCHY');
  for (;;) {
    const word = words.next().toLowerCase();
    const inside = open.at(-1);
    if (word === 'root' || word === 'joint') {
      if (nodes.length >= MOST_JOINTS) throw new Error(`${words.file}: has more than ${MOST_JOINTS} joints`);
      const name: string[] = [];
      while (words.peek() !== '{') name.push(words.next());
      words.expect('{');
      nodes.push({ name: name.join(' '), parent: inside ?? -1, offset: [0, 0, 0], channels: [] });
      open.push(nodes.length - 1);
    } else if (word === 'end') {
      // An End Site: its offset is of no joint.
      while (words.next() !== '}');
    } else if (word === '}') {
      open.pop();
    } else if (word === 'motion' && open.length === 0) {
      return nodes;
    } else if (word === 'offset' && inside !== undefined) {
      nodes[inside]!.offset = [words.number('OFFSET'), words.number('OFFSET'), words.number('OFFSET')];
    } else if (word === 'channels' && inside !== undefined) {
      const count = words.number('CHANNELS');
      for (let c = 0; c < count; c++) nodes[inside]!.channels.push(channelOf(words.next(), words.file));
    } else {
      throw new Error(
        `${words.file}: has "${word.slice(0, 32)}" where a joint, OFFSET, CHANNELS or MOTION is expected`,
      );
    }
  }
}

function channelOf(word: string, file: string): Channel {
  const match = CHANNEL.exec(word);
  if (!match)
    throw new Error(`${file}: has a channel "${word.slice(0, 32)}"; allowed: X, Y or Z with position or rotation`);
  return { axis: 'xyz'.indexOf(match[1]!.toLowerCase()), turns: match[2]!.toLowerCase() === 'rotation' };
}

/** Reads a BVH file. */
export function readBvh(text: string, file: string): Recording {
  const words = new Words(text, file);
  const nodes = readHierarchy(words);
  words.expect('Frames:');
  const frames = words.number('Frames');
  words.expect('Frame');
  words.expect('Time:');
  const frameTime_s = words.number('Frame Time');
  checkLength(frames, file);
  if (!(frameTime_s > 0)) throw new Error(`${file}: Frame Time is ${frameTime_s}; it has to be above 0`);
  const count = nodes.length;
  const places = new Float32Array(frames * count * 3);
  const turns = new Float32Array(frames * count * 4);
  const [place, turn, step] = [new Vector3(), new Quaternion(), new Quaternion()];
  for (let f = 0; f < frames; f++) {
    for (let n = 0; n < count; n++) {
      const node = nodes[n]!;
      place.fromArray(node.offset);
      turn.identity();
      for (const { axis, turns: isTurn } of node.channels) {
        const value = words.number(`frame ${f}, joint ${node.name}`);
        if (isTurn) turn.multiply(step.setFromAxisAngle(AXES[axis]!, (value * Math.PI) / 180));
        else place.setComponent(axis, value);
      }
      place.multiplyScalar(UNIT_M);
      if (node.parent >= 0) {
        const from = f * count + node.parent;
        place.applyQuaternion(step.fromArray(turns, from * 4)).add(new Vector3().fromArray(places, from * 3));
        turn.premultiply(step);
      }
      place.toArray(places, (f * count + n) * 3);
      turn.toArray(turns, (f * count + n) * 4);
    }
  }
  if (!words.isAtEnd) throw new Error(`${file}: has numbers after its ${frames} frames`);
  return { names: nodes.map((node) => node.name), fps: rateOf(frameTime_s), frames, places, turns };
}

/** Frames a second; 0.0333333 means 30. */
function rateOf(frameTime_s: number): number {
  const fps = 1 / frameTime_s;
  const round = Math.round(fps);
  return Math.abs(fps - round) < 0.01 ? round : fps;
}

/** Six decimals, without trailing zeros. */
function number(value: number): string {
  const text = value.toFixed(6).replace(/\.?0+$/, '');
  return text === '-0' ? '0' : text;
}

/** Writes a clip: six channels at the root, three rotations (Z X Y) at every other joint. */
export function writeBvh(clip: Clip, { skeleton }: Rig): string {
  const { names, parents, offsets } = skeleton;
  const lines = ['HIERARCHY'];
  const order: number[] = [];
  const write = (joint: number, depth: number): void => {
    const tab = '\t'.repeat(depth);
    const at = joint === 0 ? [0, 0, 0] : Array.from(offsets.subarray(joint * 3, joint * 3 + 3), (m) => m / UNIT_M);
    const children = names.flatMap((_, child) => (parents[child] === joint ? [child] : []));
    const moves = joint === 0 ? 'CHANNELS 6 Xposition Yposition Zposition' : 'CHANNELS 3';
    order.push(joint);
    lines.push(`${tab}${joint === 0 ? 'ROOT' : 'JOINT'} ${names[joint]}`, `${tab}{`);
    lines.push(`${tab}\tOFFSET ${at.map(number).join(' ')}`, `${tab}\t${moves} Zrotation Xrotation Yrotation`);
    for (const child of children) write(child, depth + 1);
    if (children.length === 0) lines.push(`${tab}\tEnd Site`, `${tab}\t{`, `${tab}\t\tOFFSET 0 0 0`, `${tab}\t}`);
    lines.push(`${tab}}`);
  };
  write(0, 0);
  lines.push('MOTION', `Frames: ${clip.frames}`, `Frame Time: ${1 / clip.fps}`);
  const angles = new Euler();
  for (let f = 0; f < clip.frames; f++) {
    const { root, rotations } = poseAt(clip, f);
    const row = Array.from(root, (metres) => metres / UNIT_M);
    for (const joint of order) {
      angles.setFromQuaternion(quaternionAt(rotations, joint), 'ZXY');
      for (const radians of [angles.z, angles.x, angles.y]) row.push((radians * 180) / Math.PI);
    }
    lines.push(row.map(number).join(' '));
  }
  return `${lines.join('\n')}\n`;
}
