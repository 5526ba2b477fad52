// The character in the scene: put in, how it walks, what it leaves, taken out.
import { Button, Group, Select, SimpleGrid, Slider, Stack, Text } from '@mantine/core';
import { useState } from 'react';
import { Panel } from '../app/Panel';
import { report } from '../live/store';
import type { Scenes } from './scenes';
import { useScenes } from './store';

export function ActorPanel({ scenes }: { scenes: Scenes }) {
  const [isOpen, setOpen] = useState(true);
  const scene = useScenes((state) => state.scene);
  const actor = useScenes((state) => state.actor);
  if (scene === null) return null;
  return (
    <Panel
      title="Character"
      id="actor"
      isOpen={isOpen}
      onToggle={() => {
        setOpen(!isOpen);
      }}
    >
      <Stack gap="sm">
        {actor !== null && <Acts scenes={scenes} />}
        <PutIn scenes={scenes} isFirst={actor === null} />
      </Stack>
    </Panel>
  );
}

function PutIn({ scenes, isFirst }: { scenes: Scenes; isFirst: boolean }) {
  const [chosen, setChosen] = useState<string | null>(null);
  const [isBusy, setBusy] = useState(false);
  const packs = useScenes((state) => state.packs);
  const pack = chosen ?? (packs.find((one) => one.is_default) ?? packs[0])?.name ?? '';
  return (
    <Stack gap={6}>
      {packs.length > 1 && isFirst && (
        <Select
          label="Pack"
          size="xs"
          data={packs.map(({ name }) => name)}
          value={pack}
          allowDeselect={false}
          onChange={setChosen}
        />
      )}
      <Button
        size={isFirst ? 'xs' : 'compact-xs'}
        variant={isFirst ? 'filled' : 'default'}
        loading={isBusy}
        disabled={!pack}
        onClick={() => {
          setBusy(true);
          scenes
            .putActor(pack)
            .catch(report)
            .finally(() => {
              setBusy(false);
            });
        }}
      >
        {isFirst ? 'Add a character' : 'Add another one'}
      </Button>
    </Stack>
  );
}

function Acts({ scenes }: { scenes: Scenes }) {
  const { styles, style, speed } = useScenes();
  const { actors } = scenes;
  return (
    <>
      <Select
        label="Style"
        size="xs"
        searchable
        data={styles.map(({ name }) => name)}
        value={style}
        allowDeselect={false}
        onChange={(name) => {
          if (name) actors.setStyle(name);
        }}
      />
      <div>
        <Group justify="space-between">
          <Text size="xs" fw={500} span>
            Speed
          </Text>
          <Text size="xs" c="dimmed" span>
            {speed.toFixed(1)} m/s
          </Text>
        </Group>
        <Slider
          size="sm"
          min={0.3}
          max={6}
          step={0.1}
          label={null}
          thumbLabel="Speed, metres a second"
          value={speed}
          onChange={(value) => {
            useScenes.setState({ speed: value });
          }}
        />
      </div>
      <SimpleGrid cols={2} spacing={6}>
        <Button
          size="compact-xs"
          variant="default"
          onClick={() => {
            actors.tell({ end_interaction: {} });
          }}
        >
          End it (X)
        </Button>
        <Button
          size="compact-xs"
          variant="default"
          onClick={() => {
            actors.tell({ drop: {} });
          }}
        >
          Put down (G)
        </Button>
        <Button
          size="compact-xs"
          variant="default"
          onClick={() => {
            actors.tell({ cancel: {} });
          }}
        >
          Cancel (B)
        </Button>
        <Button
          size="compact-xs"
          variant="default"
          onClick={() => {
            scenes.takeActorOut();
          }}
        >
          Remove it
        </Button>
      </SimpleGrid>
    </>
  );
}
