import { expect, test } from 'vitest';
import { partKey } from './names';

const SPELLINGS: [string, string[]][] = [
  [
    'upperarm.l',
    [
      'UpperArm_L',
      'mixamorig:LeftArm',
      'mixamorigLeftArm',
      'upperarm_l',
      'upper_arm.L',
      'J_Bip_L_UpperArm',
      'LeftUpperArm',
    ],
  ],
  ['lowerarm.r', ['LowerArm_R', 'mixamorig:RightForeArm', 'forearm.R', 'lowerarm_r', 'DEF-forearm.R', 'right_elbow']],
  ['upperleg.r', ['UpperLeg_R', 'mixamorig:RightUpLeg', 'thigh_r', 'thigh.R', 'RightUpperLeg']],
  ['lowerleg.l', ['LowerLeg_L', 'mixamorig:LeftLeg', 'calf_l', 'shin.L', 'J_Bip_L_LowerLeg']],
  ['toes.l', ['Toes_L', 'mixamorig:LeftToeBase', 'ball_l', 'toe.L']],
  ['hips', ['Hips', 'mixamorig:Hips', 'pelvis', 'J_Bip_C_Hips']],
];

test.each(SPELLINGS)('%s has many spellings', (key, names) => {
  for (const name of names) expect(partKey(name), name).toBe(key);
});

test('a name that ends in an l has no side', () => {
  expect(partKey('pelvis_roll')).toBe('pelvisroll');
  expect(partKey('Skull')).toBe('skull');
});
