// Names for the server's messages, as JSON has them. The types are made from its OpenAPI document
// (npm run generate).
import type { components } from './gen/openapi';

type Schemas = components['schemas'];

/** Fields at their defaults may be left out, in what is sent and in what comes. */
type Loose<T> = { [K in keyof T]?: T[K] | undefined };

export type Pack = Omit<Schemas['Pack'], 'bodies' | 'words' | 'skills'> & {
  bodies?: Body[];
  words?: string[];
  skills?: Skill[];
};
export type Skill = Schemas['PackSkill'];
export type Body = Schemas['PackBody'];
export type Joint = Schemas['Joint'];
export type Style = Schemas['Style'];
export type Session = Schemas['Session'];
export type SessionOptions = Loose<Schemas['SessionOptions']>;
export type SessionProblem = Schemas['SessionProblem'];
export type Problem = Schemas['Problem'];
export type SessionEvent = Schemas['SessionEvent'];
/** What happened: one of the fields. */
export type EventKind = Omit<SessionEvent, 'frame'>;
export type SessionEvents = Schemas['SessionEvents'];
export type FrameBlock = Schemas['FrameBlock'];
export type PeekResponse = Schemas['PeekResponse'];
export type PlanView = Schemas['PlanView'];
export type StepResponse = Schemas['StepResponse'];
export type Frames = Schemas['Frames'];
export type Intermediates = Schemas['Intermediates'];
export type InBetweenResponse = Schemas['InBetweenResponse'];
export type CommandResult = Schemas['CommandResult'];

export interface Vec3 {
  x: number;
  y: number;
  z: number;
}

export interface PathPoint {
  position: Vec3;
  heading?: number;
  time?: number;
}

/** A keyframe with root and pose. Rotations are (w, x, y, z), four numbers a joint. */
export interface Keyframe {
  root?: { position?: Vec3; heading?: number | null } | null;
  pose?: { rotations: number[]; root_height?: number } | null;
}

/** A character of an in-betweening request. */
export interface InBetweenCharacter {
  id: string;
  context: Keyframe[];
  targets: Keyframe[];
  frame_count?: number;
  seed: number;
  temperature: number;
  pose_steps: number;
  hold_feet: boolean;
  return_intermediates: boolean;
}

export interface InBetweenRequest {
  pack: string;
  characters: InBetweenCharacter[];
}

export interface Locomote {
  velocity?: Vec3;
  facing?: number;
  style?: string;
  gait?: string;
  height?: number;
}

export interface FollowPath {
  points: PathPoint[];
  speed?: number;
  style?: string;
  loop?: boolean;
}

export type Intent =
  | { locomote: Locomote }
  | { follow_path: FollowPath }
  | { perform: { text: string; pack?: string; seconds?: number; temperature?: number } }
  | { interact: { instance: string; variant?: string; approach?: string } }
  | { skill: { name: string; variant?: string } }
  | { end_interaction: Record<string, never> }
  | { cancel: Record<string, never> }
  | { drop: Record<string, never> };

/** A command with an intent, or a sign of life without one. */
export type Command = { session_id: string; sequence: number } & (Intent | object);

/** What a pack can do. */
export function can(pack: { capabilities?: string[] } | undefined, capability: string): boolean {
  return pack?.capabilities?.includes(capability) ?? false;
}
