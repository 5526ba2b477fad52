// The page as a whole: help, both themes, access, reference pictures, a restart of the server.
import AxeBuilder from '@axe-core/playwright';
import type { Page } from '@playwright/test';
import { apart, expect, focusStage, openCourtyard, ownPlace, test, waitForCrowd } from './viewer';

const MODES = ['live', 'scenes', 'inbetween'] as const;

async function waitForMode(page: Page, mode: (typeof MODES)[number]): Promise<void> {
  if (mode === 'live') await waitForCrowd(page, 2);
  else if (mode === 'scenes')
    await expect.poll(() => page.evaluate(() => window.troupeScenes?.connection())).toBe('live');
  else
    await expect.poll(() => page.evaluate(() => window.editor?.frames() ?? 0), { timeout: 45_000 }).toBeGreaterThan(0);
}

for (const mode of MODES) {
  test(`${mode}: the keys open help, and it has no serious fault of access`, async ({ page, open }) => {
    test.setTimeout(120_000);
    if (mode === 'scenes') await openCourtyard(page, open, '&sel=stool');
    else await open(`mode=${mode}&n=2${mode === 'inbetween' ? '&clip=walk' : ''}`);
    await waitForMode(page, mode);
    for (const theme of ['light', 'dark'] as const) {
      await page.emulateMedia({ colorScheme: theme });
      await expect(page.locator('html')).toHaveAttribute('data-mantine-color-scheme', theme);
      // Colours fade into the other theme, slowly where software draws.
      const serious = async (): Promise<string[]> => {
        const { violations } = await new AxeBuilder({ page }).analyze();
        return violations
          .filter(({ impact }) => impact === 'serious' || impact === 'critical')
          .map(({ id, nodes }) => `${theme} ${id}: ${nodes.map(({ html }) => html).join(' | ')}`);
      };
      await expect.poll(serious, { timeout: 20_000 }).toEqual([]);
    }
    await focusStage(page);
    await page.keyboard.press('?');
    const help = page.getByRole('dialog', { name: 'Keys and pointer' });
    await expect(help).toBeVisible();
    await page.keyboard.press('Escape');
    await expect(help).toBeHidden();
  });
}

for (const theme of ['light', 'dark'] as const) {
  test(`looks as it did, ${theme}`, async ({ page, open }) => {
    await page.setViewportSize({ width: 800, height: 500 });
    await page.emulateMedia({ colorScheme: theme });
    // One character with a fixed seed, that stands, with time stopped.
    await open('mode=live&n=1&cam=0,0.7,0,2.6,1.15,4');
    await waitForCrowd(page, 1);
    await page.waitForTimeout(1500);
    await focusStage(page);
    await page.keyboard.press(' ');
    await expect(page.getByRole('button', { name: 'Go on (Space)' })).toBeVisible();
    await page.mouse.move(400, 2);
    await expect(page).toHaveScreenshot(`stage-${theme}.png`);
  });
}

test('goes on after a restart of the server', async ({ page, open, server }) => {
  test.setTimeout(300_000);
  await open('mode=live&n=4');
  await waitForCrowd(page, 4);
  const ids = await page.evaluate(() => window.troupe!.ids());
  const before = await ownPlace(page);
  await server.kill();
  await expect(page.getByText(/The connection is lost/)).toBeVisible();
  await server.run();
  await expect(page.getByText(/The connection is lost/)).toBeHidden({ timeout: 30_000 });
  expect(await page.evaluate(() => window.troupe!.connection())).toBe('live');
  // The same characters at the same places, and the own one obeys.
  expect(await page.evaluate(() => window.troupe!.ids())).toEqual(ids);
  expect(apart(await ownPlace(page), before)).toBeLessThan(1);
  await focusStage(page);
  await page.keyboard.down('w');
  await expect.poll(async () => apart(await ownPlace(page), before), { timeout: 20_000 }).toBeGreaterThan(1);
  await page.keyboard.up('w');
});
