// Sentences that the own character acts out. But for the last test the words come from a tiny pack
// of random weights: what it does means nothing.
import { mkdtempSync, rmSync, symlinkSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import AxeBuilder from '@axe-core/playwright';
import type { Page } from '@playwright/test';
import { TroupeServer } from './server';
import { expect, test as base, waitForCrowd } from './viewer';

const ROOT = resolve(import.meta.dirname, '../..');

/** A server with people, a robot and a pack of words. */
const test = base.extend<object, { speaking: TroupeServer }>({
  speaking: [
    // eslint-disable-next-line no-empty-pattern
    async ({}, use) => {
      const folder = mkdtempSync(join(tmpdir(), 'troupe-words-'));
      const packs = { human: 'models/human', g1: 'models/g1', words: 'engine/tests/vermo' };
      for (const [name, of] of Object.entries(packs)) symlinkSync(join(ROOT, of), join(folder, name));
      const server = await TroupeServer.start(['--packs', folder]);
      await use(server);
      await server.stop();
      rmSync(folder, { recursive: true, force: true });
    },
    { scope: 'worker', timeout: 300_000 },
  ],
});

const field = (page: Page) => page.getByLabel('Say what it should do');
const words = (page: Page) => page.getByRole('status', { name: 'Words' });

test('acts out a sentence and says which words it does not know', async ({ page, speaking }) => {
  await page.goto(`${speaking.page}#mode=live&n=1`);
  await waitForCrowd(page, 1);
  await expect(page.getByRole('button', { name: 'Do' })).toBeDisabled();
  await field(page).fill('an old robot walks');
  await field(page).press('Enter');
  await expect(words(page)).toContainText('Acts out “an old robot walks”', { timeout: 30_000 });
  await expect(words(page)).toContainText('The pack has not learnt: robot');
  const before = await page.evaluate(() => window.troupe!.position()!);
  await expect
    .poll(async () => {
      const [x, , z] = await page.evaluate(() => window.troupe!.position()!);
      return Math.hypot(x - before[0], z - before[2]);
    })
    .toBeGreaterThan(0.02);
  for (const scheme of ['light', 'dark'] as const) {
    await page.emulateMedia({ colorScheme: scheme });
    await page.screenshot({ path: `../target/web-tests/words-${scheme}.png` });
  }
  const { violations } = await new AxeBuilder({ page }).include('#player-body').analyze();
  expect(violations.map((one) => one.id)).toEqual([]);
  // A key takes it over.
  await page
    .locator('canvas')
    .first()
    .click({ position: { x: 500, y: 120 } });
  await page.keyboard.down('w');
  await expect(words(page)).not.toContainText('Acts out', { timeout: 20_000 });
  await page.keyboard.up('w');
});

test('says what is wrong with a sentence', async ({ page, speaking }) => {
  await page.goto(`${speaking.page}#mode=live&n=1`);
  await waitForCrowd(page, 1);
  await field(page).fill('zz '.repeat(60));
  await field(page).press('Enter');
  await expect(page.getByText(/pieces long/)).toBeVisible();
  await expect(words(page)).toBeEmpty();
});

test('says why a body takes no words', async ({ page, speaking }) => {
  await page.goto(`${speaking.page}#mode=live&n=1&pack=g1`);
  await waitForCrowd(page, 1);
  await expect(page.getByText('This body cannot act out words: tiny-vermo has other joints.')).toBeVisible();
  await expect(field(page)).toHaveCount(0);
});

test('acts out a sentence by the trained pack', async ({ page, server }) => {
  await page.goto(`${server.page}#mode=live&n=1`);
  await waitForCrowd(page, 1);
  await field(page).fill('an elderly person waves');
  await field(page).press('Enter');
  await expect(words(page)).toContainText('Acts out “an elderly person waves”', { timeout: 30_000 });
  await expect(words(page)).not.toContainText('has not learnt');
});
