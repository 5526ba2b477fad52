// What the stage says while the server has no scene: how to get one.
import { Button, Text } from '@mantine/core';
import { useState } from 'react';
import { report } from '../live/store';
import type { Scenes } from './scenes';
import { useScenes } from './store';

export function EmptyServer({ scenes }: { scenes: Scenes }) {
  const isEmpty = useScenes((state) => state.connection === 'live' && state.isRead && state.scenes.length === 0);
  const [isBusy, setBusy] = useState(false);
  if (!isEmpty) return null;
  const upload = async () => {
    const { COURTYARD } = await import('./examples');
    await scenes.upload(COURTYARD.map(([name, text]) => ({ name, text })));
  };
  return (
    <section className="card" aria-label="No scene yet">
      <Text fw={600} mb={4}>
        This server has no scene yet
      </Text>
      <Text size="sm" c="dimmed" mb="md">
        Upload the example: a courtyard with things to use, and a stool on which a character sits down. Or drop the TOML
        or JSON files of your own scene and its objects on the page.
      </Text>
      <Button
        size="xs"
        loading={isBusy}
        onClick={() => {
          setBusy(true);
          upload()
            .catch(report)
            .finally(() => {
              setBusy(false);
            });
        }}
      >
        Upload the courtyard
      </Button>
    </section>
  );
}
