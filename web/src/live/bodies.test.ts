import { expect, test } from 'vitest';
import type { Api } from '../wire/api';
import type { Pack } from '../wire/types';
import { Bodies } from './bodies';

/** A server with one live pack. `asked` has the names of the packs that were asked for. */
function serverWith(pack: Partial<Pack>): { api: Api; asked: string[] } {
  const asked: string[] = [];
  const api = {
    packs: () => Promise.resolve([pack]),
    pack: (name: string) => {
      asked.push(name);
      return Promise.resolve({ joints: [], contact_joints: [], ...pack });
    },
    styles: (name: string) => {
      asked.push(name);
      return Promise.resolve({ styles: [], default_style: '' });
    },
  };
  return { api: api as unknown as Api, asked };
}

const HUMAN: Partial<Pack> = { name: 'human', capabilities: ['live'], bodies: [] };

test('asks the server for no pack that it has not listed', async () => {
  const { api, asked } = serverWith(HUMAN);
  const bodies = new Bodies(api);
  await expect(bodies.of('human', '')).rejects.toThrow(/pack: is “human”.*not known yet/);
  await bodies.load();
  await expect(bodies.of('', '')).rejects.toThrow(/pack: is “”; the server's live packs are human/);
  expect(asked).toEqual([]);
  expect((await bodies.of('human', '')).pack).toBe('human');
  expect(asked).toEqual(['human', 'human']);
});
