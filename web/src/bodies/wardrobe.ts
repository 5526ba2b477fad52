// Characters of the user's own on the bodies of the server's packs: files become skins, and motion
// is carried over.
import { create } from 'zustand';
import type { BodyKind } from '../live/bodies';
import { WasmCarrier } from '../retarget/carrier';
import type { Certificate } from '../retarget/certificate';
import { fitHero, readHero } from '../retarget/character';
import { sourceOf } from '../retarget/source';
import { OtherBones, type Stage } from '../stage';
import type { Api } from '../wire/api';

/** A character's file, and what became of it. */
export interface Outfit {
  file: File;
  /** The body that wears it. */
  kind: BodyKind;
  /** Refused: its figures are beyond the bar. */
  state: 'worn' | 'refused';
  joints: number;
  /** 0 while it is refused. */
  triangles: number;
  /** How motion is carried over; none for files with the pack's own bones. */
  fit: { certificate: Certificate; scale: number; parts: string } | undefined;
  /** Corrections of the character's parts, as TOML; empty without any. */
  corrections: string;
}

interface Wardrobe {
  /** At most one of each state for a body. */
  outfits: readonly Outfit[];
  isBusy: boolean;
}

export const useWardrobe = create<Wardrobe>(() => ({ outfits: [], isBusy: false }));

/** What a file chooser offers. */
export const CHARACTERS = '.glb,.vrm';
/** Larger files are not read, bytes. */
const MOST_BYTES = 256 * 1024 * 1024;

/** The server and the stage that characters stand on. */
export interface Room {
  stage: Stage;
  api: Api;
}

/**
 * Gives all characters of a body the skin of a file. One whose figures are beyond the bar is worn only if `anyway` says
 * so. Returns what became of it. Throws an error for a file that cannot be worn at all.
 */
export async function wear(
  room: Room,
  kind: BodyKind,
  file: File,
  { anyway = false, corrections = '' } = {},
): Promise<Outfit> {
  if (!/\.(glb|vrm)$/i.test(file.name))
    throw new Error(`${file.name}: is not a glb or vrm; drop a skinned .glb or .vrm file`);
  if (file.size > MOST_BYTES) throw new Error(`${file.name}: has ${file.size} bytes; at most ${MOST_BYTES} are read`);
  useWardrobe.setState({ isBusy: true });
  try {
    const outfit = await fitted(room, kind, file, anyway, corrections);
    // A refused one does not take off what is worn.
    forget(kind, outfit.state === 'refused' ? ['refused'] : ['worn', 'refused']);
    useWardrobe.setState(({ outfits }) => ({ outfits: [...outfits, outfit] }));
    return outfit;
  } finally {
    useWardrobe.setState({ isBusy: false });
  }
}

/** Brings back what the characters of a body looked like before. */
export async function takeOff({ stage }: Room, kind: BodyKind): Promise<void> {
  await stage.setSkin(kind.skeleton, null);
  forget(kind, ['worn']);
}

/** Forgets a file that was refused. */
export function dismiss(kind: BodyKind): void {
  forget(kind, ['refused']);
}

function forget(kind: BodyKind, states: readonly Outfit['state'][]): void {
  useWardrobe.setState(({ outfits }) => ({
    outfits: outfits.filter((one) => one.kind.key !== kind.key || !states.includes(one.state)),
  }));
}

async function fitted(
  { stage, api }: Room,
  kind: BodyKind,
  file: File,
  anyway: boolean,
  corrections: string,
): Promise<Outfit> {
  const { skeleton } = kind;
  const glb = await file.arrayBuffer();
  const common = { file, kind, corrections };
  try {
    const report = await stage.setSkin(skeleton, glb);
    return { ...common, state: 'worn', joints: report!.joints, triangles: report!.triangles, fit: undefined };
  } catch (error) {
    if (!(error instanceof OtherBones)) throw error;
  }
  const hero = await readHero(file.name, new Uint8Array(glb), corrections);
  try {
    const source = await sourceOf(api, kind.pack, kind.body);
    const { retargeter, certificate } = await fitHero(source, hero);
    try {
      const fit = { certificate, scale: retargeter.scale, parts: hero.body.parts() };
      const joints = hero.skeleton.names.length;
      if (certificate.faults.length > 0 && !anyway) return { ...common, state: 'refused', joints, triangles: 0, fit };
      const carrier = new WasmCarrier(retargeter, hero.skeleton, skeleton.names.length, source.ground_m);
      const report = await stage.setSkin(skeleton, glb, carrier);
      return { ...common, state: 'worn', joints, triangles: report!.triangles, fit };
    } finally {
      retargeter.free();
    }
  } finally {
    hero.body.free();
  }
}
