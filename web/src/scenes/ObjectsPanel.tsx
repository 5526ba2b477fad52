// The objects of the scene, and another one of a definition.
import { Button, Group, Select, Stack, Text, UnstyledButton } from '@mantine/core';
import { useState } from 'react';
import { Panel } from '../app/Panel';
import { report } from '../live/store';
import type { Scenes } from './scenes';
import { useScenes } from './store';
import { nameOf } from './types';

export function ObjectsPanel({ scenes }: { scenes: Scenes }) {
  const [isOpen, setOpen] = useState(true);
  const scene = useScenes((state) => state.scene);
  if (scene === null) return null;
  return (
    <Panel
      title="Objects"
      id="objects"
      isOpen={isOpen}
      onToggle={() => {
        setOpen(!isOpen);
      }}
    >
      <Stack gap="sm">
        <ObjectList scenes={scenes} />
        <AddObject scenes={scenes} />
      </Stack>
    </Panel>
  );
}

function ObjectList({ scenes }: { scenes: Scenes }) {
  const { objects, object: chosen } = useScenes();
  if (objects.length === 0) {
    return (
      <Text size="xs" c="dimmed">
        No objects yet.
      </Text>
    );
  }
  return (
    <ul className="objects" aria-label="Objects of the scene">
      {objects.map(({ id, definition, state }) => (
        <li key={id}>
          <UnstyledButton
            aria-pressed={id === chosen}
            onClick={() => {
              scenes.choose(id === chosen ? null : id);
            }}
          >
            <span>{id}</span>
            <small>{state === 'OBJECT_STATE_FREE' ? definition : `${definition}, ${nameOf(state)}`}</small>
          </UnstyledButton>
        </li>
      ))}
    </ul>
  );
}

function AddObject({ scenes }: { scenes: Scenes }) {
  const { definitions, placing, tool } = useScenes();
  if (definitions.length === 0) {
    return (
      <Text size="xs" c="dimmed">
        Drop the TOML or JSON file of an object on the page to place such objects.
      </Text>
    );
  }
  return (
    <Stack gap={6}>
      <Select
        label="Another object"
        size="xs"
        searchable
        data={definitions.map(({ name }) => name)}
        value={placing}
        allowDeselect={false}
        onChange={(name) => {
          useScenes.setState({ placing: name });
        }}
      />
      <Group gap="xs" grow>
        <Button
          size="compact-xs"
          px={4}
          variant={tool === 'place' ? 'filled' : 'default'}
          aria-pressed={tool === 'place'}
          onClick={() => {
            scenes.setTool(tool === 'place' ? 'choose' : 'place');
          }}
        >
          Where I click (P)
        </Button>
        <Button
          size="compact-xs"
          px={4}
          variant="default"
          onClick={() => {
            scenes.add().catch(report);
          }}
        >
          In the middle
        </Button>
      </Group>
    </Stack>
  );
}
