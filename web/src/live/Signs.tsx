// What the page says: its head, the banner of a broken connection, and lines that pass.
import { Button } from '@mantine/core';
import { ApiError, askForAnotherKey } from '../wire/api';
import type { Connection } from './store';
import { useLive } from './store';

export function Head() {
  const characters = useLive((state) => state.characters);
  const connection = useLive((state) => state.connection);
  const path = useLive((state) => state.path);
  const says = characters === 0 ? 'opening a crowd …' : `${characters} live character${characters === 1 ? '' : 's'}`;
  return (
    <header className="head">
      <h1>Troupe</h1>
      <p>
        {connection === 'connecting' ? 'connecting …' : says}
        {path.state === 'walking' && ` · yours ${path.text}`}
      </p>
    </header>
  );
}

export function Banner() {
  const connection = useLive((state) => state.connection);
  const trouble = useLive((state) => state.trouble);
  return <ConnectionBanner connection={connection} trouble={trouble} />;
}

/** What becomes of the connection after an error at the start. */
export function connectionAfter(error: unknown): Connection {
  if (!(error instanceof ApiError)) return 'failed';
  if (error.isAboutKeys) return 'locked';
  return error.mayPass ? 'reconnecting' : 'failed';
}

/** Says that a connection is gone. */
export function ConnectionBanner({ connection, trouble }: { connection: Connection; trouble: string }) {
  if (connection === 'connecting' || connection === 'live') return null;
  return (
    <div className="banner" role="status">
      <i />
      {connection === 'reconnecting' ? `The connection is lost (${trouble}). Reconnecting …` : trouble}
      {connection === 'locked' && (
        <Button size="compact-sm" onClick={askForAnotherKey}>
          Use another key
        </Button>
      )}
      {connection === 'failed' && (
        <Button
          size="compact-sm"
          variant="default"
          onClick={() => {
            location.reload();
          }}
        >
          Try again
        </Button>
      )}
    </div>
  );
}

export function Notices() {
  const notices = useLive((state) => state.notices);
  return (
    <div className="notices" role="log" aria-live="polite">
      {notices.map(({ id, text, kind }) => (
        <div key={id} className="notice" data-kind={kind}>
          {text}
        </div>
      ))}
    </div>
  );
}
