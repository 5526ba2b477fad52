// The bodies that the server's packs move, and what they can do.
import type { Skeleton } from '../stage/types';
import type { Api } from '../wire/api';
import { bodyKey } from '../wire/codec';
import type { Joint, Pack, Skill, Style } from '../wire/types';
import { can } from '../wire/types';
import type { Speaker } from './words';

/** A body: a pack of one skeleton, or one of a pack's bodies. */
export interface BodyKind {
  key: string;
  pack: string;
  /** Empty for packs of one skeleton. */
  body: string;
  fps: number;
  capabilities: readonly string[];
  skeleton: Skeleton;
  /** Indices of the joints that touch the ground, in the order of the bits of a frame's contacts. */
  contactJoints: readonly number[];
  /** Words that its clips show, for packs whose styles are words. */
  words: readonly string[];
  /** What it can do where it stands. */
  skills: readonly Skill[];
  /** Codes of each head of a motion token; 0 without tokens. */
  codes: number;
  heads: number;
  contextFrames: number;
  styles: Style[];
  defaultStyle: string;
}

export function skeletonOf(joints: readonly Joint[]): Skeleton {
  return {
    names: joints.map((joint) => joint.name),
    parents: Int16Array.from(joints, (joint) => joint.parent),
    offsets: Float32Array.from(joints.flatMap(({ offset }) => [offset?.x ?? 0, offset?.y ?? 0, offset?.z ?? 0])),
  };
}

/** Bodies by key: skeletons and styles are fetched when they are first wanted. */
export class Bodies {
  private readonly known = new Map<string, Promise<BodyKind>>();
  private readonly ready = new Map<string, BodyKind>();
  private readonly details = new Map<string, Promise<Pack>>();
  packs: Pack[] = [];
  /** Names of the packs that make motion of words. */
  private speaking: string[] = [];

  constructor(private readonly api: Api) {}

  async load(): Promise<void> {
    const all = await this.api.packs();
    this.packs = all.filter((pack) => can(pack, 'live'));
    this.speaking = all.filter((pack) => can(pack, 'text')).map((pack) => pack.name);
  }

  get defaultPack(): Pack | undefined {
    return this.packs.find((pack) => pack.is_default) ?? this.packs[0];
  }

  pack(name: string): Pack | undefined {
    return this.packs.find((pack) => pack.name === name);
  }

  /** The body, once it was fetched. */
  get(key: string): BodyKind | undefined {
    return this.ready.get(key);
  }

  /** The packs that make motion of words, with their joints. */
  speakers(): Promise<Speaker[]> {
    return Promise.all(this.speaking.map((name) => this.detail(name)));
  }

  /** Fetches a body's skeleton and styles. An empty body is the pack's default one. Throws for a pack that is not live. */
  async of(packName: string, bodyName: string): Promise<BodyKind> {
    const pack = this.pack(packName);
    if (!pack) throw new Error(`pack: is “${packName}”; the server's live packs are ${this.names()}`);
    const bodies = pack.bodies ?? [];
    const body = bodyName || (bodies[0]?.name ?? '');
    const key = bodyKey(packName, body);
    const found = this.known.get(key) ?? this.fetch(key, packName, body);
    this.known.set(key, found);
    try {
      return await found;
    } catch (error) {
      this.known.delete(key);
      throw error;
    }
  }

  /** Reads the styles of a body again. */
  async renewStyles(kind: BodyKind): Promise<void> {
    kind.styles = (await this.api.styles(kind.pack, kind.body)).styles;
  }

  private names(): string {
    return this.packs.map((pack) => pack.name).join(', ') || 'not known yet';
  }

  private detail(packName: string): Promise<Pack> {
    const detail = this.details.get(packName) ?? this.api.pack(packName);
    this.details.set(packName, detail);
    detail.catch(() => this.details.delete(packName));
    return detail;
  }

  private async fetch(key: string, packName: string, bodyName: string): Promise<BodyKind> {
    const [pack, { styles, default_style }] = await Promise.all([
      this.detail(packName),
      this.api.styles(packName, bodyName),
    ]);
    const body = pack.bodies?.find((one) => one.name === bodyName);
    const skeleton = skeletonOf(body?.joints ?? pack.joints);
    const contacts = body?.contact_joints ?? pack.contact_joints;
    const kind: BodyKind = {
      key,
      pack: packName,
      body: bodyName,
      fps: pack.fps,
      capabilities: pack.capabilities,
      skeleton,
      contactJoints: contacts.map((name) => skeleton.names.indexOf(name)),
      words: body ? body.words : [],
      skills: pack.skills ?? [],
      codes: pack.codes,
      heads: pack.heads,
      contextFrames: pack.context_frames,
      styles,
      defaultStyle: default_style,
    };
    this.ready.set(key, kind);
    return kind;
  }
}

/** Least difference between the heights of a style's gaits for which commands may choose a height, metres. */
const HEIGHT_RANGE_M = 0.12;

/** Heights that a style's commands may choose from, metres. */
export function heightRange(style: Style | undefined): [number, number] | undefined {
  const heights = (style?.gaits ?? []).map((gait) => gait.height);
  if (heights.length === 0) return undefined;
  const [low, high] = [Math.min(...heights), Math.max(...heights)];
  return high - low > HEIGHT_RANGE_M ? [low, high] : undefined;
}

/** Speed of the fastest gait of a style, or twice its usual speed if it has no gaits, m/s. */
export function runningSpeed(style: Style | undefined): number {
  const usual = style?.default_speed ?? 1.3;
  const fastest = Math.max(0, ...(style?.gaits ?? []).map((gait) => gait.forward));
  return fastest > usual * 1.2 ? fastest : usual * 2;
}
