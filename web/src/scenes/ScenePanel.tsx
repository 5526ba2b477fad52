// Which scene is shown: choose, make, or delete one.
import { Button, Group, Select, Stack, TextInput } from '@mantine/core';
import { useState } from 'react';
import { Panel, Row } from '../app/Panel';
import { report } from '../live/store';
import type { Scenes } from './scenes';
import { useScenes } from './store';

export function ScenePanel({ scenes }: { scenes: Scenes }) {
  const [isOpen, setOpen] = useState(true);
  const all = useScenes((state) => state.scenes);
  const { scene, colliders, ground } = useScenes();
  return (
    <Panel
      title="Scene"
      id="scene"
      isOpen={isOpen}
      onToggle={() => {
        setOpen(!isOpen);
      }}
    >
      <Stack gap="sm">
        {all.length > 0 && (
          <Select
            label="Shown"
            size="xs"
            searchable
            data={all.map(({ name }) => name)}
            value={scene}
            allowDeselect={false}
            onChange={(name) => {
              if (name) scenes.open(name).catch(report);
            }}
          />
        )}
        {scene !== null && (
          <div>
            <Row label="Colliders" value={`${colliders}`} />
            <Row label="Height of the ground" value={`${ground.toFixed(2)} m`} />
          </div>
        )}
        <NewScene scenes={scenes} />
        {scene !== null && <DeleteScene scenes={scenes} key={scene} name={scene} />}
      </Stack>
    </Panel>
  );
}

function NewScene({ scenes }: { scenes: Scenes }) {
  const [name, setName] = useState('');
  const [wrong, setWrong] = useState('');
  return (
    <form
      onSubmit={(event) => {
        event.preventDefault();
        scenes.makeScene(name.trim()).then(
          () => {
            setName('');
          },
          (error: unknown) => {
            setWrong(error instanceof Error ? error.message : String(error));
          },
        );
      }}
    >
      <TextInput
        label="New scene"
        size="xs"
        maxLength={64}
        placeholder="name"
        value={name}
        error={wrong || undefined}
        onChange={(event) => {
          setName(event.currentTarget.value);
          setWrong('');
        }}
        rightSection={
          <Button type="submit" size="compact-xs" disabled={!name.trim()}>
            Make
          </Button>
        }
        rightSectionWidth={56}
      />
    </form>
  );
}

function DeleteScene({ scenes, name }: { scenes: Scenes; name: string }) {
  const [asks, setAsks] = useState(false);
  if (!asks) {
    return (
      <Button
        size="compact-xs"
        variant="default"
        onClick={() => {
          setAsks(true);
        }}
      >
        Delete this scene …
      </Button>
    );
  }
  return (
    <Group gap="xs" grow>
      <Button
        size="compact-xs"
        color="red.9"
        onClick={() => {
          scenes.deleteScene().catch(report);
        }}
      >
        Delete {name}
      </Button>
      <Button
        size="compact-xs"
        variant="default"
        onClick={() => {
          setAsks(false);
        }}
      >
        Keep it
      </Button>
    </Group>
  );
}
