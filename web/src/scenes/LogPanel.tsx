// What happened: the events of the characters, newest first.
import { Text } from '@mantine/core';
import { useState } from 'react';
import { Panel } from '../app/Panel';
import { useScenes } from './store';

export function LogPanel() {
  const [isOpen, setOpen] = useState(true);
  const scene = useScenes((state) => state.scene);
  const log = useScenes((state) => state.log);
  if (scene === null) return null;
  return (
    <Panel
      title="Events"
      id="events"
      isOpen={isOpen}
      onToggle={() => {
        setOpen(!isOpen);
      }}
    >
      {log.length === 0 ? (
        <Text size="xs" c="dimmed">
          Nothing has happened yet.
        </Text>
      ) : (
        <ol className="events" role="log" aria-label="Events" tabIndex={0}>
          {log.toReversed().map(({ id, frame, seconds, who, text, failed }) => (
            <li key={id} data-failed={failed || undefined}>
              <time>
                {seconds.toFixed(1)} s<small>frame {frame}</small>
              </time>
              <span>
                {who} {text}
              </span>
            </li>
          ))}
        </ol>
      )}
    </Panel>
  );
}
