// Who is in the crowd, and how many.
import { Select, Slider, Stack, Text } from '@mantine/core';
import { useEffect, useState } from 'react';
import { Panel } from '../app/Panel';
import { bodyKey } from '../wire/codec';
import type { Pack } from '../wire/types';
import { MOST_CHARACTERS } from './cast';
import type { Live } from './live';
import { report, useLive } from './store';

export function CrowdPanel({ live }: { live: Live }) {
  const [isOpen, setOpen] = useState(true);
  return (
    <Panel
      title="Crowd"
      id="crowd"
      isOpen={isOpen}
      onToggle={() => {
        setOpen(!isOpen);
      }}
    >
      <CrowdForm live={live} />
    </Panel>
  );
}

function keysOf(packs: readonly Pack[]): string[] {
  return packs.flatMap((pack) =>
    pack.bodies?.length ? pack.bodies.map((body) => bodyKey(pack.name, body.name)) : [pack.name],
  );
}

/** Names of the styles that a crowd of one body may have. */
function useStyles(live: Live, who: string): string[] {
  const [found, setFound] = useState<{ who: string; names: string[] }>({ who: '', names: [] });
  const packs = useLive((state) => state.packs);
  useEffect(() => {
    if (packs.length === 0) return;
    const [pack = '', body = ''] = who === 'mixed' ? [live.bodies.defaultPack?.name] : who.split('/');
    live.bodies.of(pack, body).then((kind) => {
      setFound({ who, names: kind.styles.map((style) => style.name) });
    }, report);
  }, [live, who, packs]);
  return found.who === who ? found.names : [];
}

function CrowdForm({ live }: { live: Live }) {
  const { crowd, packs, busy } = useLive();
  const [count, setCount] = useState<number>();
  const styles = useStyles(live, crowd.who);
  return (
    <Stack gap="sm">
      <div>
        <div className="row">
          <Text size="xs" fw={500} span c="var(--ink)">
            Characters
          </Text>
          <Text size="xs" c="dimmed" span>
            {count ?? crowd.count}
            {busy ? ' …' : ''}
          </Text>
        </div>
        <Slider
          size="sm"
          min={1}
          max={MOST_CHARACTERS}
          label={null}
          thumbLabel="Characters"
          value={count ?? crowd.count}
          onChange={setCount}
          onChangeEnd={(value) => {
            setCount(undefined);
            void live.changeCrowd({ ...crowd, count: value });
          }}
        />
      </div>
      <Select
        label="Who"
        size="xs"
        data={[{ value: 'mixed', label: 'mixed' }, ...keysOf(packs)]}
        value={crowd.who}
        allowDeselect={false}
        onChange={(who) => {
          if (who) void live.changeCrowd({ ...crowd, who, style: '' });
        }}
      />
      <Select
        label="Styles"
        size="xs"
        data={[{ value: '', label: 'all, in turn' }, ...styles]}
        value={crowd.style}
        allowDeselect={false}
        onChange={(style) => {
          void live.changeCrowd({ ...crowd, style: style ?? '' });
        }}
      />
    </Stack>
  );
}
