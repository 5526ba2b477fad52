import { Kbd, Modal, Text } from '@mantine/core';
import type { ReactNode } from 'react';
import { Fragment } from 'react';

/** Keys, and what they do. */
export type Keys = readonly (readonly [readonly string[], string])[];

const KEYS: Keys = [
  [['W', 'A', 'S', 'D'], 'walk; arrow keys do the same'],
  [['Shift'], 'run'],
  [['Q', 'E'], 'face left, face right'],
  [['X'], 'face the way it walks again'],
  [['P'], 'draw a path with the pointer'],
  [['F'], 'follow the selected character'],
  [['Tab'], 'next character, while the stage has the focus'],
  [['I'], 'look inside the selected character'],
  [['N'], 'numbers'],
  [['Space'], 'pause and go on'],
  [['.'], 'one frame'],
  [['C'], 'bring your character back into the picture'],
  [['Home'], 'camera as at the start'],
  [['V'], 'people as bodies or as capsules'],
  [['T'], 'light or dark'],
  [['Esc'], 'stop drawing; move between the stage and the tools'],
  [['?'], 'this help'],
];

interface Props {
  opened: boolean;
  onClose: () => void;
  /** Default: those of the live mode. */
  keys?: Keys;
  /** What the pointer does. */
  children?: ReactNode;
}

export function Help({ opened, onClose, keys = KEYS, children = <LivePointer /> }: Props) {
  return (
    <Modal opened={opened} onClose={onClose} title="Keys and pointer" centered size="lg">
      <dl className="keys">
        {keys.map(([names, says]) => (
          <Fragment key={says}>
            <dt>
              {names.map((key) => (
                <Kbd key={key} mr={4}>
                  {key}
                </Kbd>
              ))}
            </dt>
            <dd>{says}</dd>
          </Fragment>
        ))}
      </dl>
      <Text size="sm" c="dimmed" mt="md">
        {children}
      </Text>
    </Modal>
  );
}

function LivePointer() {
  return (
    <>
      Click the ground to go there, click a character to select it. Drag to turn the camera, drag with the second button
      to move it, turn the wheel to come nearer. The camera comes along when your character walks out of the picture.
      With a gamepad the left stick goes, the right stick faces, and A runs. Drop a skinned glb or vrm on the page, and
      the selected body wears it.
    </>
  );
}
