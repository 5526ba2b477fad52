// What somebody sees who opens Scenes for the first time: with the example scenes of `make run`, and without any scene.
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import type { Page } from '@playwright/test';
import { TroupeServer } from './server';
import { expect, focusStage, isInSight, switchMode, test as base, waitForCrowd } from './viewer';

const ROOT = resolve(import.meta.dirname, '../..');
/** Height of the hips of a person who sits, and of one who stands, metres. */
const [SITS_BELOW_M, STANDS_ABOVE_M] = [0.65, 0.85];

const test = base.extend<object, { served: TroupeServer; empty: TroupeServer }>({
  served: [
    // Playwright wants the first argument spelt so.
    // eslint-disable-next-line no-empty-pattern
    async ({}, use) => {
      const folder = mkdtempSync(join(tmpdir(), 'troupe-examples-'));
      execFileSync(join(ROOT, 'scripts/example-folders.sh'), [folder]);
      const folders = ['--scenes', join(folder, 'scenes'), '--objects', join(folder, 'objects')];
      const server = await TroupeServer.start(['--packs', join(ROOT, 'models/human'), ...folders]);
      await use(server);
      await server.stop();
      rmSync(folder, { recursive: true, force: true });
    },
    { scope: 'worker', timeout: 300_000 },
  ],
  empty: [
    // eslint-disable-next-line no-empty-pattern
    async ({}, use) => {
      const server = await TroupeServer.start(['--packs', join(ROOT, 'models/human')]);
      await use(server);
      await server.stop();
    },
    { scope: 'worker', timeout: 300_000 },
  ],
});

/** Height of the chosen character's hips, metres; 0 before it is shown. */
const hips = (page: Page) => page.evaluate(() => window.troupeScenes?.position()?.[1] ?? 0);

async function sitsDown(page: Page): Promise<void> {
  await expect.poll(() => hips(page), { timeout: 30_000 }).toBeGreaterThan(STANDS_ABOVE_M);
  await expect(page.getByRole('log', { name: 'Events' }).getByText(/reached sit of stool/)).toBeVisible({
    timeout: 60_000,
  });
  await expect.poll(() => hips(page)).toBeLessThan(SITS_BELOW_M);
  await expect.poll(() => isInSight(page, 'troupeScenes')).toBe(true);
}

test('the first scene is open, and a character sits down; keys take over', async ({ page, served, watched }) => {
  test.setTimeout(180_000);
  await page.goto(served.page);
  await waitForCrowd(page, 3);
  await switchMode(page, 'Scenes');
  await expect(page.getByText('courtyard · 6 objects · 1 character')).toBeVisible({ timeout: 30_000 });
  await expect(page.getByText(/Your character sits down on stool/)).toBeVisible();
  await sitsDown(page);
  // Walking ends the interaction.
  await focusStage(page);
  await page.keyboard.down('w');
  await expect.poll(() => hips(page), { timeout: 30_000 }).toBeGreaterThan(STANDS_ABOVE_M);
  await page.keyboard.up('w');
  await expect(page.getByRole('button', { name: 'stool seat', exact: true })).toBeVisible();
  expect(watched.errors).toEqual([]);
});

test('a character stands before the seat that another one has', async ({ page, served, context }) => {
  test.setTimeout(180_000);
  await page.goto(`${served.page}#mode=scenes&scene=plaza`);
  await sitsDown(page);
  const other = await context.newPage();
  await other.goto(`${served.page}#mode=scenes&scene=plaza`);
  await expect(other.getByText(/Another character has stool/)).toBeVisible({ timeout: 30_000 });
  await expect.poll(() => hips(other), { timeout: 30_000 }).toBeGreaterThan(STANDS_ABOVE_M);
  await other.close({ runBeforeUnload: true });
  await page.getByRole('button', { name: 'Remove it', exact: true }).click();
});

test('a page that is loaded again finds the seat free', async ({ page, served }) => {
  test.setTimeout(180_000);
  await page.goto(`${served.page}#mode=scenes&scene=plaza`);
  await sitsDown(page);
  await page.reload();
  await expect(page.getByText('plaza · 1 object · 1 character')).toBeVisible({ timeout: 30_000 });
  await sitsDown(page);
  // The tests that follow find the seat free.
  await page.getByRole('button', { name: 'Remove it', exact: true }).click();
});

test('a scene whose character was removed stays empty', async ({ page, served }) => {
  test.setTimeout(120_000);
  await page.goto(`${served.page}#mode=scenes&scene=plaza`);
  await expect(page.getByText('plaza · 1 object · 1 character')).toBeVisible({ timeout: 30_000 });
  await page.getByRole('button', { name: 'Remove it', exact: true }).click();
  await expect(page.getByText('plaza · 1 object · 0 characters')).toBeVisible();
  await expect(page).toHaveURL(/n=0/);
  await page.reload();
  await expect(page.getByText('plaza · 1 object · 0 characters')).toBeVisible({ timeout: 30_000 });
  await page.waitForTimeout(1500);
  expect(await hips(page)).toBe(0);
});

test('a server without scenes offers the example, and a character sits down in it', async ({ page, empty }) => {
  test.setTimeout(180_000);
  await page.goto(`${empty.page}#mode=scenes`);
  const card = page.getByRole('region', { name: 'No scene yet' });
  await expect(card).toBeVisible({ timeout: 30_000 });
  await card.getByRole('button', { name: 'Upload the courtyard' }).click();
  await expect(card).toBeHidden();
  await sitsDown(page);
});

test('C brings the character back into the picture', async ({ page, served }) => {
  test.setTimeout(120_000);
  await page.goto(`${served.page}#mode=scenes&scene=plaza`);
  await expect.poll(() => hips(page), { timeout: 30_000 }).toBeGreaterThan(0);
  await page.getByRole('button', { name: 'Find the character (C)' }).click();
  expect(await isInSight(page, 'troupeScenes')).toBe(true);
  await page.getByRole('button', { name: 'Camera as at the start (Home)' }).click();
  await expect.poll(() => isInSight(page, 'troupeScenes')).toBe(true);
});
