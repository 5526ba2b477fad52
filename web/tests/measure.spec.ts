// What a crowd costs a browser and its server, without drawing: `make viewer-figures`.
import { readdirSync } from 'node:fs';
import { resolve } from 'node:path';
import type { FromWorker, ToWorker } from '../src/wire/messages';
import { expect, test } from './viewer';

const ASSETS = resolve(import.meta.dirname, '../dist/assets');
const CHARACTERS = 200;
const RATE_HZ = 30;
const WARM_UP_S = 5;
const SECONDS = 30;
/** Sessions that one call opens. */
const CHUNK = 50;

interface Seen {
  ticks: number;
  bytes: number;
  /** Characters of the last tick. */
  characters: number;
  decode_ms: number[];
  dropped: number;
  seconds: number;
}

test(`${CHARACTERS} characters at ${RATE_HZ} Hz @measure`, async ({ page, server }) => {
  test.setTimeout(300_000);
  const worker = readdirSync(ASSETS).find((name) => /^drive\.worker-.*\.js$/.test(name));
  if (!worker) throw new Error('web/dist has no worker: npm run build');
  // A page of the server on which nothing is drawn, so that only the stream and its worker take
  // time.
  await page.goto(`${server.page}healthz`);
  await page.evaluate(
    async ([count, chunk]) => {
      for (let first = 0; first < count; first += chunk) {
        const sessions = Array.from({ length: chunk }, (_, nth) => {
          const [x, z] = [((first + nth) % 20) * 2, Math.floor((first + nth) / 20) * 2];
          return { id: `m${first + nth}`, position: { x, y: 0, z }, seed: first + nth };
        });
        const headers = { 'content-type': 'application/json' };
        const answer = await fetch('/v1/sessions', { method: 'POST', headers, body: JSON.stringify({ sessions }) });
        if (!answer.ok) throw new Error(await answer.text());
      }
    },
    [CHARACTERS, CHUNK] as const,
  );
  const run = (seconds: number): Promise<Seen> =>
    page.evaluate(
      async ([name, characters, rate_hz, span]) => {
        const worker = new Worker(`/assets/${name}`, { type: 'module' });
        const tell = (message: ToWorker) => {
          worker.postMessage(message);
        };
        const ids = Array.from({ length: characters }, (_, nth) => `m${nth}`);
        const seen = { ticks: 0, bytes: 0, characters: 0, decode_ms: [] as number[], dropped: 0, seconds: 0 };
        let [sequence, from, dropped] = [Math.round(performance.now()), 0, 0];
        await new Promise<void>((done, fail) => {
          worker.onmessage = ({ data }: MessageEvent<FromWorker>) => {
            if (data.kind === 'opened') tell({ kind: 'attach', ids });
            else if (data.kind === 'closed') fail(new Error(`the stream ended: ${data.reason}`));
            else if (data.kind === 'tick') {
              if (data.tick % 60 === 0) {
                sequence += 1;
                tell({
                  kind: 'commands',
                  commands: ids.map((session_id, nth) => {
                    const heading = nth + 0.7 * sequence;
                    const velocity = { x: 1.2 * Math.sin(heading), y: 0, z: 1.2 * Math.cos(heading) };
                    return { session_id, sequence, locomote: { velocity } };
                  }),
                });
              }
              const now = performance.now();
              if (from === 0) [from, dropped] = [now, data.dropped_ticks];
              seen.ticks += 1;
              seen.bytes += data.bytes;
              seen.characters = data.blocks.reduce((sum, { slots }) => sum + slots.length, 0);
              seen.decode_ms.push(data.decode_ms);
              seen.dropped = data.dropped_ticks - dropped;
              seen.seconds = (now - from) / 1000;
              if (seen.seconds >= span) done();
            }
          };
          tell({ kind: 'open', url: `ws://${location.host}/v1/drive`, rate_hz });
        });
        tell({ kind: 'close' });
        worker.terminate();
        return seen;
      },
      [worker, CHARACTERS, RATE_HZ, seconds] as const,
    );
  await run(WARM_UP_S);
  await page.waitForTimeout(1000);
  const [before, at] = [server.cpuSeconds(), Date.now()];
  const seen = await run(SECONDS);
  const cores = (server.cpuSeconds() - before) / ((Date.now() - at) / 1000);
  expect(seen.characters).toBe(CHARACTERS);
  const sorted = seen.decode_ms.toSorted((a, b) => a - b);
  const quantile = (share: number) => sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))]!;
  console.log(
    [
      `${CHARACTERS} characters, ${seen.ticks} ticks in ${seen.seconds.toFixed(1)} s (${seen.dropped} dropped)`,
      `${Math.round(seen.bytes / seen.seconds / 1000)} kB/s, ${Math.round(seen.bytes / seen.ticks)} bytes a tick`,
      `decoding a tick in the worker: median ${quantile(0.5).toFixed(2)} ms, p99 ${quantile(0.99).toFixed(2)} ms`,
      `server: ${(100 * cores).toFixed(0)} % of a core`,
    ].join('\n'),
  );
});
