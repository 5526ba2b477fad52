// Names of joints: the same part under the many spellings of rigs, engines and exporters.

/** A joint's name, taken apart. */
export interface PartName {
  /** 'l', 'r' or '' for the middle. */
  side: 'l' | 'r' | '';
  /** The part in the words of the packs, such as `upperarm`; other names are kept, without prefix, side and marks. */
  part: string;
}

/** Other spellings of parts, without side and marks. Those of Mixamo, VRM, Unreal, Rigify, Blender and SMPL. */
const SYNONYMS: Record<string, string> = {
  pelvis: 'hips',
  hip: 'hips',
  root: 'root',
  spine01: 'spine',
  abdomen: 'spine',
  upperchest: 'chest',
  spine2: 'chest',
  spine3: 'chest',
  spine03: 'chest',
  thorax: 'chest',
  torso: 'chest',
  neck01: 'neck',
  neck1: 'neck',
  clavicle: 'shoulder',
  collar: 'shoulder',
  collarbone: 'shoulder',
  arm: 'upperarm',
  humerus: 'upperarm',
  forearm: 'lowerarm',
  elbow: 'lowerarm',
  wrist: 'hand',
  upleg: 'upperleg',
  thigh: 'upperleg',
  femur: 'upperleg',
  leg: 'lowerleg',
  calf: 'lowerleg',
  shin: 'lowerleg',
  knee: 'lowerleg',
  ankle: 'foot',
  toe: 'toes',
  toebase: 'toes',
  ball: 'toes',
  toe0: 'toes',
};

/** Takes a name apart: `mixamorig:LeftForeArm`, `forearm.L` and `LowerArm_L` are all the left `lowerarm`. */
export function partOf(name: string): PartName {
  // Prefixes: a namespace, Mixamo's with its colon lost (as three.js does), VRM's J_Bip_C_, and
  // DEF- of Rigify.
  let rest = name
    .replace(/^.*[:|]/, '')
    .replace(/^mixamorig\d*_?/i, '')
    .replace(/^J_(Bip|Sec|Adj)_/i, '')
    .replace(/^(DEF|ORG|Bip\d+)[-_ ]/i, '')
    .replace(/_joint$|_link$/i, '');
  let side: PartName['side'] = '';
  const patterns: [RegExp, boolean][] = [
    [/^(left|right)[_\-. ]?/i, true],
    [/[_\-. ]?(left|right)$/i, true],
    [/^([lr])[_\-. ]/i, true],
    [/[_\-. ]([lr])$/i, true],
    [/^([LR])(?=[A-Z])/, true],
    [/(?<=[a-z])([LR])$/, true],
  ];
  for (const [pattern] of patterns) {
    const match = pattern.exec(rest);
    if (!match) continue;
    side = match[1]!.toLowerCase().startsWith('l') ? 'l' : 'r';
    rest = rest.replace(pattern, '');
    break;
  }
  rest = rest
    .replace(/^C[_\-. ]/, '')
    .toLowerCase()
    .replace(/[^a-z0-9]/g, '');
  return { side, part: SYNONYMS[rest] ?? rest };
}

/** A key that is equal for equal parts. */
export function partKey(name: string): string {
  const { side, part } = partOf(name);
  return side === '' ? part : `${part}.${side}`;
}
