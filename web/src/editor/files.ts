// Clips from and to files.
import type { Clip, Rig } from './clip';
import { writeBvh } from './bvh';
import { writeCsv } from './csv';
import { writeGlb } from './glb';
import { understand, type Given, type Understood } from './reading';

export type Format = 'bvh' | 'glb' | 'csv';

/** Larger files are not read, bytes. */
const MOST_BYTES = 256 * 1024 * 1024;

/** What a file chooser offers. */
export const ACCEPTED = '.bvh,.glb,.gltf,.vrm,.csv,.npz,.npy';

/** Formats that a clip of a rig can be written as. */
export function formatsFor(rig: Rig): Format[] {
  return rig.hinges.length > 0 ? ['bvh', 'glb', 'csv'] : ['bvh', 'glb'];
}

export async function readClip(file: File, rig: Rig, given: Given): Promise<Understood> {
  return understand(file.name, await bytesOf(file), rig, given);
}

export async function bytesOf(file: File): Promise<Uint8Array<ArrayBuffer>> {
  if (file.size > MOST_BYTES) throw new Error(`${file.name}: has ${file.size} bytes; at most ${MOST_BYTES} are read`);
  return new Uint8Array(await file.arrayBuffer());
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
