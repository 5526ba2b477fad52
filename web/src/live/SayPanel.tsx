// What the own character should do, in words: it acts them out and goes on.
import { Button, Text, TextInput } from '@mantine/core';
import { useState } from 'react';
import type { Live } from './live';
import { useLive } from './store';
import { MOST_CHARACTERS_OF_TEXT, unknownNote } from './words';

export function Say({ live }: { live: Live }) {
  const mute = useLive((state) => state.mute);
  const saying = useLive((state) => state.saying);
  const [text, setText] = useState('');
  if (mute !== undefined) {
    return mute === '' ? null : (
      <Text size="xs" c="dimmed">
        {mute}
      </Text>
    );
  }
  const notes = [saying.trouble, unknownNote(saying.unknown)].filter((note) => note !== '');
  return (
    <form
      onSubmit={(event) => {
        event.preventDefault();
        if (text.trim()) live.say(text.trim());
      }}
    >
      <TextInput
        label="Say what it should do"
        placeholder="a person waves"
        size="xs"
        maxLength={MOST_CHARACTERS_OF_TEXT}
        value={text}
        onChange={(event) => {
          setText(event.currentTarget.value);
        }}
        rightSection={
          <Button type="submit" size="compact-xs" disabled={!text.trim()}>
            Do
          </Button>
        }
        rightSectionWidth={52}
      />
      <div role="status" aria-label="Words">
        {saying.state !== 'silent' && (
          <Text size="xs" mt={4}>
            {saying.state === 'waiting' ? 'Thinks about it …' : `Acts out “${saying.text}”`}
          </Text>
        )}
        {notes.map((note) => (
          <Text size="xs" c="dimmed" mt={4} key={note}>
            {note}
          </Text>
        ))}
      </div>
    </form>
  );
}
