// The characters of the user's own that the crowd wears: what was found, what is kept of the motion, and why one is
// refused.
import { Alert, Button, Stack, Text } from '@mantine/core';
import { useState } from 'react';
import { Panel, Row } from '../app/Panel';
import { report } from '../live/store';
import { Faults, FiguresTable } from './FiguresTable';
import { dismiss, takeOff, useWardrobe, wear, type Outfit, type Room } from './wardrobe';

export function OutfitPanel({ room }: { room: Room }) {
  const [isOpen, setOpen] = useState(true);
  const outfits = useWardrobe((state) => state.outfits);
  if (outfits.length === 0) return null;
  return (
    <Panel
      title="Characters of your own"
      id="outfits"
      isOpen={isOpen}
      onToggle={() => {
        setOpen(!isOpen);
      }}
    >
      <Stack gap="md">
        {outfits.map((outfit) => (
          <OutfitCard key={`${outfit.kind.key} ${outfit.state}`} room={room} outfit={outfit} />
        ))}
      </Stack>
    </Panel>
  );
}

function OutfitCard({ room, outfit }: { room: Room; outfit: Outfit }) {
  const isBusy = useWardrobe((state) => state.isBusy);
  const { file, kind, state, joints, fit, corrections } = outfit;
  const isRefused = state === 'refused';
  return (
    <Stack gap={6} role="group" aria-label={file.name}>
      <Row label={isRefused ? 'Refused' : `Worn by ${kind.key}`} value={file.name} />
      <Row label="Joints" value={`${joints}, the pack has ${kind.skeleton.names.length}`} />
      {fit && <Row label="Its legs, by the pack’s" value={fit.scale.toFixed(2)} />}
      {fit && !isRefused && (
        <Text size="xs" c="dimmed">
          Drawn at the crowd’s size, {(1 / fit.scale).toFixed(2)} times its own, so that places on the ground are those
          of the server.
        </Text>
      )}
      {!fit && (
        <Text size="xs" c="dimmed">
          Its bones are the pack’s own: motion applies as it is.
        </Text>
      )}
      {fit && fit.certificate.faults.length > 0 && (
        <Alert color={isRefused ? 'red' : 'yellow'} variant="light" p="xs" title="Beyond the bar">
          <Faults certificate={fit.certificate} />
          {isRefused && (
            <Button
              size="compact-xs"
              mt={6}
              loading={isBusy}
              onClick={() => {
                wear(room, kind, file, { anyway: true, corrections }).catch(report);
              }}
            >
              Wear it anyway
            </Button>
          )}
        </Alert>
      )}
      {fit && <FiguresTable certificate={fit.certificate} />}
      {fit && (
        <details>
          <summary>Parts that were found</summary>
          <pre className="parts">{fit.parts}</pre>
          <Text size="xs" c="dimmed">
            Drop a corrected .toml together with the character.
          </Text>
        </details>
      )}
      <Button
        size="xs"
        variant="default"
        onClick={() => {
          if (isRefused) dismiss(kind);
          else takeOff(room, kind).catch(report);
        }}
      >
        {isRefused ? 'Dismiss' : 'Take it off'}
      </Button>
    </Stack>
  );
}
