// Clips from and to files: the name's ending decides.
import type { Clip, Rig } from './clip';
import { readBvh, writeBvh } from './bvh';
import { readCsv, writeCsv } from './csv';
import { readGlb, writeGlb } from './glb';
import { onSkeleton } from './recording';

export type Format = 'bvh' | 'glb' | 'csv';

/** Larger files are not read, bytes. */
const MOST_BYTES = 256 * 1024 * 1024;

/** What a file chooser offers. */
export const ACCEPTED = '.bvh,.glb,.csv';

export function formatOf(file: string): Format {
  const ending = /\.([^.]*)$/.exec(file.toLowerCase())?.[1] ?? '';
  if (ending === 'bvh' || ending === 'glb' || ending === 'csv') return ending;
  throw new Error(`${file}: is neither BVH, glb nor CSV; the name ends in .bvh, .glb or .csv`);
}

/** Formats that a clip of a rig can be written as. */
export function formatsFor(rig: Rig): Format[] {
  return rig.hinges.length > 0 ? ['bvh', 'glb', 'csv'] : ['bvh', 'glb'];
}

export async function readClip(file: File, rig: Rig): Promise<Clip> {
  const format = formatOf(file.name);
  if (file.size > MOST_BYTES) throw new Error(`${file.name}: has ${file.size} bytes; at most ${MOST_BYTES} are read`);
  if (format === 'csv') return readCsv(await file.text(), rig, file.name);
  const read =
    format === 'bvh'
      ? readBvh(await file.text(), file.name)
      : await readGlb(await file.arrayBuffer(), rig.fps, file.name);
  return onSkeleton(read, rig, file.name);
}

export async function writeClip(clip: Clip, rig: Rig, format: Format): Promise<Blob> {
  switch (format) {
    case 'bvh':
      return new Blob([writeBvh(clip, rig)], { type: 'text/plain' });
    case 'csv':
      return new Blob([writeCsv(clip, rig)], { type: 'text/csv' });
    case 'glb':
      return new Blob([await writeGlb(clip, rig)], { type: 'model/gltf-binary' });
  }
}

/** Hands a file to the person. */
export function save(blob: Blob, name: string): void {
  const url = URL.createObjectURL(blob);
  const link = document.createElement('a');
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => {
    URL.revokeObjectURL(url);
  }, 10_000);
}
