// The own character: body, style, skills, speed, gait, height, blends of words, and what it should do in words.
import { Button, Group, Select, Slider, Stack, Text } from '@mantine/core';
import { useState } from 'react';
import { Panel } from '../app/Panel';
import { heightRange } from './bodies';
import { Blend } from './Blend';
import type { Live } from './live';
import { Say } from './SayPanel';
import { Skills } from './SkillsPanel';
import { report, useLive } from './store';

export function PlayerPanel({ live }: { live: Live }) {
  const [isOpen, setOpen] = useState(true);
  return (
    <Panel
      title="Your character"
      id="player"
      isOpen={isOpen}
      onToggle={() => {
        setOpen(!isOpen);
      }}
    >
      <PlayerForm live={live} />
    </Panel>
  );
}

function PlayerForm({ live }: { live: Live }) {
  const { packs, player, styles, words } = useLive();
  const pack = packs.find((one) => one.name === player.pack);
  const bodies = pack?.bodies ?? [];
  const style = styles.find((one) => one.name === player.style);
  const heights = heightRange(style);
  const gaits = style?.gaits ?? [];
  const change = (packName: string, body: string) => {
    live.changeOwn(packName, body, '').catch(report);
  };
  return (
    <Stack gap="sm">
      <Group grow gap="xs">
        <Select
          label="Pack"
          size="xs"
          data={packs.map((one) => one.name)}
          value={player.pack}
          allowDeselect={false}
          onChange={(name) => {
            if (name) change(name, '');
          }}
        />
        {bodies.length > 0 && (
          <Select
            label="Body"
            size="xs"
            data={bodies.map((body) => body.name)}
            value={player.body}
            allowDeselect={false}
            onChange={(name) => {
              if (name) change(player.pack, name);
            }}
          />
        )}
      </Group>
      <Group grow gap="xs">
        <Select
          label="Style"
          size="xs"
          data={styles.map((one) => one.name)}
          value={player.style}
          allowDeselect={false}
          onChange={(name) => {
            if (name) live.setPlayer({ style: name });
          }}
        />
        {gaits.length > 0 && (
          <Select
            label="Gait"
            size="xs"
            data={[{ value: '', label: 'automatic' }, ...gaits.map((gait) => gait.name)]}
            value={player.gait}
            allowDeselect={false}
            onChange={(name) => {
              live.setPlayer({ gait: name ?? '' });
            }}
          />
        )}
      </Group>
      <Skills live={live} />
      <Field label="Speed" value={`${player.speed.toFixed(1)} m/s`}>
        <Slider
          size="sm"
          min={0.3}
          max={6}
          step={0.1}
          label={null}
          thumbLabel="Speed, metres a second"
          value={player.speed}
          onChange={(speed) => {
            live.setPlayer({ speed });
          }}
        />
      </Field>
      {heights && (
        <Field label="Height of the hips" value={`${(player.height ?? heights[1]).toFixed(2)} m`}>
          <Slider
            size="sm"
            min={heights[0]}
            max={heights[1]}
            step={0.01}
            label={null}
            thumbLabel="Height of the hips, metres"
            value={player.height ?? heights[1]}
            onChange={(height) => {
              live.setPlayer({ height });
            }}
          />
        </Field>
      )}
      {player.facesAway && (
        <Button
          size="compact-xs"
          variant="default"
          onClick={() => {
            live.faceFreely();
          }}
        >
          Face the way it walks (X)
        </Button>
      )}
      {words.length > 1 && <Blend live={live} key={`${player.pack}/${player.body}`} />}
      <Say live={live} />
    </Stack>
  );
}

function Field({ label, value, children }: { label: string; value: string; children: React.ReactNode }) {
  return (
    <div>
      <div className="row">
        <Text size="xs" fw={500} span c="var(--ink)">
          {label}
        </Text>
        <Text size="xs" c="dimmed" span>
          {value}
        </Text>
      </div>
      {children}
    </div>
  );
}
