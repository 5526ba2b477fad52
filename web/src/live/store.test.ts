import { expect, test } from 'vitest';
import type { Pack } from '../wire/types';
import { clearLive, notice, useLive } from './store';

test('a live mode that begins again shows no packs, and time goes on', () => {
  useLive.setState({ packs: [{ name: 'human' } as Pack], connection: 'live', time: { paused: true, speed: 0.5 } });
  notice('a line of another mode');
  clearLive();
  const { packs, connection, time, notices } = useLive.getState();
  expect(packs).toEqual([]);
  expect(connection).toBe('connecting');
  expect(time).toEqual({ paused: false, speed: 1 });
  expect(notices.map(({ text }) => text)).toEqual(['a line of another mode']);
});
