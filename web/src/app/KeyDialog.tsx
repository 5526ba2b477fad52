import { Button, Group, Modal, PasswordInput, Text } from '@mantine/core';
import { useState } from 'react';

/** Asks for the key of a server that wants one. */
export function KeyDialog({ wrong, onAnswer }: { wrong: boolean; onAnswer: (key: string | undefined) => void }) {
  const [key, setKey] = useState('');
  return (
    <Modal
      opened
      centered
      title="This server asks for a key"
      onClose={() => {
        onAnswer(undefined);
      }}
    >
      <form
        onSubmit={(event) => {
          event.preventDefault();
          if (key.trim()) onAnswer(key.trim());
        }}
      >
        <Text size="sm" c="dimmed" mb="sm">
          It stays in this tab until you close it. A server that makes its own key prints it at the start.
        </Text>
        <PasswordInput
          label="Key"
          placeholder="troupe_…"
          data-autofocus
          autoComplete="off"
          value={key}
          error={wrong ? 'The server does not know this key.' : undefined}
          onChange={(event) => {
            setKey(event.currentTarget.value);
          }}
        />
        <Group justify="flex-end" mt="md">
          <Button type="submit" disabled={!key.trim()}>
            Use it
          </Button>
        </Group>
      </form>
    </Modal>
  );
}
