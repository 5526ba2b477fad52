// A server that asks for keys: the dialog, the ticket of the stream, and what a key may not read.
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { apart, expect, focusStage, ownPlace, test as base, waitForCrowd } from './viewer';
import { binary, TroupeServer } from './server';

const PACK = resolve(import.meta.dirname, '../../models/human');

interface Locked {
  server: TroupeServer;
  /** Keys by role. */
  keys: Record<'drive' | 'admin' | 'metrics', string>;
}

function newKey(role: string): { key: string; entry: string } {
  const entry = execFileSync(binary(), ['key', 'new', '--name', role, '--role', role], { encoding: 'utf8' });
  const key = /troupe_\w+/.exec(entry)?.[0];
  if (!key) throw new Error(`no key in: ${entry}`);
  return { key, entry };
}

const test = base.extend<object, { locked: Locked }>({
  locked: [
    // Playwright wants the first argument spelt so.
    // eslint-disable-next-line no-empty-pattern
    async ({}, use) => {
      const folder = mkdtempSync(join(tmpdir(), 'troupe-keys-'));
      const [drive, admin, metrics] = ['drive', 'admin', 'metrics'].map(newKey);
      const file = join(folder, 'keys.toml');
      writeFileSync(file, [drive, admin, metrics].map((one) => one!.entry).join('\n'));
      const server = await TroupeServer.start(['--packs', PACK, '--keys', file]);
      await use({ server, keys: { drive: drive!.key, admin: admin!.key, metrics: metrics!.key } });
      await server.stop();
      rmSync(folder, { recursive: true, force: true });
    },
    { scope: 'worker', timeout: 300_000 },
  ],
});

test('asks for a key, says when it is wrong, and drives with a right one', async ({ page, locked }) => {
  test.setTimeout(120_000);
  await page.goto(`${locked.server.page}#mode=live&n=2&open=numbers`);
  const dialog = page.getByRole('dialog', { name: 'This server asks for a key' });
  await expect(dialog).toBeVisible();
  const field = dialog.getByLabel('Key', { exact: true });
  await field.fill(`${locked.keys.drive}x`);
  await dialog.getByRole('button', { name: 'Use it' }).click();
  await expect(dialog.getByText('The server does not know this key.')).toBeVisible();
  await field.fill(locked.keys.drive);
  await field.press('Enter');
  await expect(dialog).toBeHidden();
  // The stream opened with a ticket: the key is never in an address.
  await waitForCrowd(page, 2);
  expect(page.url()).not.toContain('troupe_');
  await focusStage(page);
  const before = await ownPlace(page);
  await page.keyboard.down('w');
  await expect.poll(async () => apart(await ownPlace(page), before), { timeout: 20_000 }).toBeGreaterThan(0.5);
  await page.keyboard.up('w');
  // The role drive reads no metrics: a hint, and the page's own numbers.
  await expect(page.getByText(/may not read the server's numbers/)).toBeVisible();
  await expect(page.getByText('This page', { exact: true })).toBeVisible();
  // The tab keeps the key.
  await page.reload();
  await waitForCrowd(page, 2);
  await expect(dialog).toBeHidden();
});

test('a key of the role admin reads the numbers', async ({ page, locked }) => {
  await page.addInitScript((key) => {
    sessionStorage.setItem('troupe-key', key);
  }, locked.keys.admin);
  await page.goto(`${locked.server.page}#mode=live&n=2&open=numbers`);
  await waitForCrowd(page, 2);
  await expect(page.getByText('Plan waits, p99')).toBeVisible();
  await expect(page.getByText(/may not read/)).toHaveCount(0);
});

test('a key that may do nothing here can be changed for another', async ({ page, locked }) => {
  await page.goto(`${locked.server.page}#mode=live&n=1`);
  const dialog = page.getByRole('dialog', { name: 'This server asks for a key' });
  await dialog.getByLabel('Key', { exact: true }).fill(locked.keys.metrics);
  await dialog.getByRole('button', { name: 'Use it' }).click();
  await expect(page.getByText(/the key's role is metrics/).first()).toBeVisible();
  await page.getByRole('button', { name: 'Use another key' }).click();
  await dialog.getByLabel('Key', { exact: true }).fill(locked.keys.drive);
  await dialog.getByRole('button', { name: 'Use it' }).click();
  await waitForCrowd(page, 1);
});

test('without a key the page says so, and asks again on request', async ({ page, locked }) => {
  await page.goto(`${locked.server.page}#mode=live&n=1`);
  const dialog = page.getByRole('dialog', { name: 'This server asks for a key' });
  await expect(dialog).toBeVisible();
  await page.keyboard.press('Escape');
  await expect(dialog).toBeHidden();
  await page.getByRole('button', { name: 'Use another key' }).click();
  await expect(dialog).toBeVisible();
});
