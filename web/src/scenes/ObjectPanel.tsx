// The chosen object: where it is, and what a character can do with it.
import { Button, Group, Menu, NumberInput, SimpleGrid, Stack, Text } from '@mantine/core';
import { useState } from 'react';
import { Panel } from '../app/Panel';
import { report } from '../live/store';
import type { Scenes } from './scenes';
import { useScenes } from './store';
import type { Placement, SceneObject } from './types';
import { headingOf, nameOf, placementOf, upright } from './types';

export function ObjectPanel({ scenes }: { scenes: Scenes }) {
  const [isOpen, setOpen] = useState(true);
  const object = useScenes((state) => state.objects.find(({ id }) => id === state.object));
  if (!object) return null;
  return (
    <Panel
      title={object.id}
      id="object"
      isOpen={isOpen}
      onToggle={() => {
        setOpen(!isOpen);
      }}
    >
      <Stack gap="sm">
        <About object={object} />
        <Where scenes={scenes} object={object} />
        <Use scenes={scenes} object={object} />
        <Button
          size="compact-xs"
          variant="default"
          onClick={() => {
            scenes.remove().catch(report);
          }}
        >
          Remove it from the scene (Del)
        </Button>
      </Stack>
    </Panel>
  );
}

function About({ object }: { object: SceneObject }) {
  const definition = useScenes((state) => state.definitions.find(({ name }) => name === object.definition));
  const state = object.state === 'OBJECT_STATE_FREE' ? 'free' : `${nameOf(object.state)} by a character`;
  return (
    <Text size="xs" c="dimmed">
      {object.definition}, {state}. {definition?.description}
    </Text>
  );
}

/** Place and heading as numbers, sent when one was changed. */
function Where({ scenes, object }: { scenes: Scenes; object: SceneObject }) {
  const { position, rotation } = placementOf(object);
  const change = (to: Placement) => {
    scenes.move(to).catch(report);
  };
  const degrees = Math.round((headingOf(rotation) * 180) / Math.PI);
  return (
    <SimpleGrid cols={4} spacing={6} key={`${object.id} ${object.revision}`}>
      {(['x', 'y', 'z'] as const).map((axis) => (
        <Field
          key={axis}
          label={`${axis} (m)`}
          step={0.1}
          value={position[axis]}
          onChange={(value) => {
            change({ position: { ...position, [axis]: value }, rotation });
          }}
        />
      ))}
      <Field
        label="turn (°)"
        step={15}
        value={degrees}
        onChange={(value) => {
          change({ position, rotation: upright((value * Math.PI) / 180) });
        }}
      />
    </SimpleGrid>
  );
}

interface FieldProps {
  label: string;
  step: number;
  value: number;
  onChange: (value: number) => void;
}

function Field({ label, step, value, onChange }: FieldProps) {
  const [text, setText] = useState<number | string>(round(value));
  const send = () => {
    if (typeof text !== 'number' || text === round(value)) return;
    onChange(text);
    // Until the server has taken it; then the field is made again.
    setText(round(value));
  };
  return (
    <NumberInput
      label={label}
      size="xs"
      step={step}
      hideControls
      value={text}
      onChange={setText}
      onBlur={send}
      onKeyDown={(event) => {
        if (event.key === 'Enter') send();
      }}
    />
  );
}

function round(value: number): number {
  return Math.round(value * 1000) / 1000;
}

/** What can be done with it. */
function Use({ scenes, object }: { scenes: Scenes; object: SceneObject }) {
  const [approach, setApproach] = useState('');
  const definition = useScenes((state) => state.definitions.find(({ name }) => name === object.definition));
  const actor = useScenes((state) => state.actor);
  const { variants = [], approaches = [] } = definition ?? {};
  return (
    <Group gap="xs" grow>
      <Menu position="bottom-start" width={230} withinPortal>
        <Menu.Target>
          <Button size="xs" disabled={actor === null}>
            Use it …
          </Button>
        </Menu.Target>
        <Menu.Dropdown>
          <Menu.Item
            rightSection={<Text size="xs">U</Text>}
            onClick={() => {
              scenes.use('', approach);
            }}
          >
            at random
          </Menu.Item>
          {variants.map(({ name }) => (
            <Menu.Item
              key={name}
              onClick={() => {
                scenes.use(name, approach);
              }}
            >
              {name}
            </Menu.Item>
          ))}
          {approaches.length > 0 && (
            <Menu.RadioGroup value={approach} onChange={setApproach}>
              <Menu.Label>From</Menu.Label>
              <Menu.RadioItem value="" closeMenuOnClick={false}>
                the nearest side
              </Menu.RadioItem>
              {approaches.map((name) => (
                <Menu.RadioItem key={name} value={name} closeMenuOnClick={false}>
                  {name}
                </Menu.RadioItem>
              ))}
            </Menu.RadioGroup>
          )}
        </Menu.Dropdown>
      </Menu>
    </Group>
  );
}
