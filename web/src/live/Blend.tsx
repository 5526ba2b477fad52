// Blends of words, for packs whose styles are words: a style of its own on the server.
import { ActionIcon, Group, Select, Slider, Stack, Text } from '@mantine/core';
import { useDebouncedCallback } from '@mantine/hooks';
import { X } from 'lucide-react';
import { useState } from 'react';
import { blendStyle, MOST_WORDS } from './blend-style';
import type { Live } from './live';
import { report, useLive } from './store';

/** Time after the last change until the blend is sent, ms. */
const SETTLE_MS = 350;

export function Blend({ live }: { live: Live }) {
  const words = useLive((state) => state.words);
  const [parts, setParts] = useState<{ word: string; share: number }[]>([]);
  const send = useDebouncedCallback((next: typeof parts) => {
    if (next.length > 0) void giveBlend(live, next).catch(report);
  }, SETTLE_MS);
  const change = (next: typeof parts) => {
    setParts(next);
    send(next);
  };
  const left = words.filter((word) => !parts.some((part) => part.word === word));
  return (
    <Stack gap={6}>
      <Text size="xs" fw={500}>
        Blend of words
      </Text>
      {parts.map(({ word, share }, i) => (
        <Group key={word} gap="xs" wrap="nowrap">
          <Text size="xs" w={72} truncate title={word}>
            {word}
          </Text>
          <Slider
            size="sm"
            style={{ flex: 1 }}
            min={0}
            max={1}
            step={0.05}
            label={null}
            thumbLabel={`Share of ${word}`}
            value={share}
            onChange={(value) => {
              change(parts.map((part, j) => (j === i ? { word, share: value } : part)));
            }}
          />
          <ActionIcon
            size="xs"
            variant="subtle"
            color="gray"
            aria-label={`Leave ${word} out`}
            onClick={() => {
              change(parts.filter((_, j) => j !== i));
            }}
          >
            <X size={12} />
          </ActionIcon>
        </Group>
      ))}
      {parts.length < MOST_WORDS && (
        <Select
          size="xs"
          searchable
          placeholder="add a word"
          aria-label="Add a word to the blend"
          data={left}
          value={null}
          onChange={(word) => {
            if (word) change([...parts, { word, share: parts.length === 0 ? 1 : 0.5 }]);
          }}
        />
      )}
    </Stack>
  );
}

/** Writes the blend as a style and has the own character move in it. */
async function giveBlend(live: Live, parts: readonly { word: string; share: number }[]): Promise<void> {
  const { own } = live;
  if (!own) return;
  const { name, style } = blendStyle(parts, useLive.getState().player.speed);
  await live.api.putStyle(own.kind.pack, own.kind.body, name, style);
  await live.bodies.renewStyles(own.kind);
  const { speed } = useLive.getState().player;
  useLive.setState({ styles: own.kind.styles });
  live.setPlayer({ style: name, speed });
}
