// Characters of the user's own, from their files.
import type { Body, Retargeter } from '../reader/troupe_reader_web';
import type { Skeleton } from '../stage/types';
import type { Certificate } from './certificate';
import { loadReader } from './reader';
import type { Source } from './source';

/** A character's file. */
export interface Hero {
  file: string;
  skeleton: Skeleton;
  body: Body;
}

/** A character, and what carries motion of a pack's body over to it. */
export interface Fitted {
  retargeter: Retargeter;
  certificate: Certificate;
}

/** Reads a character's file: its skeleton and its body. Throws an error in the reader's words. */
export async function readHero(file: string, bytes: Uint8Array, parts = ''): Promise<Hero> {
  const reader = await loadReader();
  const read = reader.character(file, bytes);
  try {
    const { names, parents, offsets } = read;
    return { file, skeleton: { names, parents, offsets }, body: read.body(parts) };
  } catch (error) {
    throw new Error(`${file}: ${error instanceof Error ? error.message : String(error)}`, { cause: error });
  } finally {
    read.free();
  }
}

/** Fits a character to a pack's body. Throws an error that says why it is impossible. */
export async function fitHero(source: Source, { file, body }: Pick<Hero, 'file' | 'body'>): Promise<Fitted> {
  const reader = await loadReader();
  try {
    const retargeter = new reader.Retargeter(source.body, body);
    const certificate = JSON.parse(retargeter.certificate()) as Certificate;
    return { retargeter, certificate };
  } catch (error) {
    throw new Error(`${file}: ${error instanceof Error ? error.message : String(error)}`, { cause: error });
  }
}
