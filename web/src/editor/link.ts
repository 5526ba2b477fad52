// Deep links of the editor: what the address says after its #.
import type { FillForm } from './store';
import { MOST_POSE_STEPS, MOST_TEMPERATURE, MOST_VARIANTS } from './store';

export interface EditorLink {
  pack?: string;
  /** `walk` opens the clip that the server makes; files cannot be linked. */
  clip?: string;
  from?: number;
  to?: number;
  targets?: number;
  form: Partial<FillForm>;
  cam?: number[];
}

function numberOf(of: URLSearchParams, name: string, low: number, high: number): number | undefined {
  const text = of.get(name);
  const value = Number(text);
  return text !== null && Number.isFinite(value) ? Math.min(Math.max(value, low), high) : undefined;
}

export function readEditorLink(hash: string): EditorLink {
  const of = new URLSearchParams(hash.replace(/^#/, ''));
  const link: EditorLink = { form: {} };
  const [pack, clip] = [of.get('pack'), of.get('clip')];
  if (pack) link.pack = pack;
  if (clip) link.clip = clip;
  const cam = of.get('cam')?.split(',').map(Number);
  if (cam?.length === 6 && cam.every(Number.isFinite)) link.cam = cam;
  for (const name of ['from', 'to', 'targets'] as const) {
    const value = numberOf(of, name, 0, 1e6);
    if (value !== undefined) link[name] = Math.round(value);
  }
  const count = numberOf(of, 'variants', 1, MOST_VARIANTS);
  const firstSeed = numberOf(of, 'seed', 0, Number.MAX_SAFE_INTEGER);
  const temperature = numberOf(of, 'temperature', 0, MOST_TEMPERATURE);
  const poseSteps = numberOf(of, 'steps', 1, MOST_POSE_STEPS);
  if (count !== undefined) link.form.count = Math.round(count);
  if (firstSeed !== undefined) link.form.firstSeed = Math.round(firstSeed);
  if (temperature !== undefined) link.form.temperature = temperature;
  if (poseSteps !== undefined) link.form.poseSteps = Math.round(poseSteps);
  return link;
}

export function writeEditorLink(link: EditorLink): string {
  const of = new URLSearchParams({ mode: 'inbetween' });
  const put = (name: string, value: string | number | undefined): void => {
    if (value !== undefined && value !== '') of.set(name, String(value));
  };
  put('pack', link.pack);
  put('clip', link.clip);
  put('from', link.from);
  put('to', link.to);
  put('targets', link.targets);
  put('variants', link.form.count);
  put('seed', link.form.firstSeed);
  put('temperature', link.form.temperature);
  put('steps', link.form.poseSteps);
  put('cam', link.cam?.map((value) => Number(value.toFixed(2))).join(','));
  return `#${of.toString().replaceAll('%2C', ',')}`;
}
