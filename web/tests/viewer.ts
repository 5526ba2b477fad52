// What the tests share: the server, the page, and what the page must never do.
import type { Page } from '@playwright/test';
import { test as base, expect } from '@playwright/test';
import { TroupeServer } from './server';

export interface Watched {
  /** Errors on the console, and uncaught exceptions. */
  errors: string[];
  /** Addresses that were asked and are not of this machine. */
  foreign: string[];
}

interface Shared {
  server: TroupeServer;
}

interface Each {
  watched: Watched;
  /** Opens the viewer at what its address says after the #. */
  open: (link: string) => Promise<void>;
}

export const test = base.extend<Each, Shared>({
  server: [
    // Playwright wants the first argument spelt so.
    // eslint-disable-next-line no-empty-pattern
    async ({}, use) => {
      const server = await TroupeServer.start();
      await use(server);
      await server.stop();
    },
    { scope: 'worker', timeout: 300_000 },
  ],

  watched: [
    async ({ page, context }, use) => {
      const watched: Watched = { errors: [], foreign: [] };
      const see = (url: string) => {
        if (!/^(?:http|ws):\/\/127\.0\.0\.1[:/]|^(?:blob|data):/.test(url)) watched.foreign.push(url);
      };
      context.on('request', (request) => {
        see(request.url());
      });
      page.on('websocket', (socket) => {
        see(socket.url());
      });
      page.on('console', (message) => {
        if (message.type() === 'error') watched.errors.push(message.text());
      });
      page.on('pageerror', (error) => watched.errors.push(error.message));
      await use(watched);
      expect(watched.foreign, 'requests that left this machine').toEqual([]);
    },
    { auto: true },
  ],

  open: async ({ page, server }, use) => {
    await use(async (link) => {
      await page.goto(`${server.page}#${link}`);
    });
  },
});

export { expect };

/** Waits until `count` live characters are on the stage. */
export async function waitForCrowd(page: Page, count: number, timeout = 45_000): Promise<void> {
  await expect.poll(() => page.evaluate(() => window.troupe?.shown() ?? 0), { timeout }).toBeGreaterThanOrEqual(count);
}

/** Root of the own character of the live mode, metres. */
export async function ownPlace(page: Page): Promise<[number, number, number]> {
  const place = await page.evaluate(() => window.troupe?.position());
  if (!place) throw new Error('the own character is not shown');
  return place;
}

/** Whether a character of a mode is in the part of the picture that no panel covers. */
export async function isInSight(page: Page, mode: 'troupe' | 'troupeScenes' = 'troupe'): Promise<boolean> {
  const place = await page.evaluate((of) => window[of]?.onScreen(), mode);
  const panels = await page.locator('.side').boundingBox();
  return !!place && place.x > 0 && place.x < (panels?.x ?? place.width) && place.y > 0 && place.y < place.height;
}

/** Shows another mode, by the control at the top. */
export async function switchMode(page: Page, label: 'Live' | 'Scenes' | 'In-between'): Promise<void> {
  await page.getByRole('radiogroup', { name: 'Mode' }).getByText(label, { exact: true }).click();
}

/** How far two places are from each other over the ground, metres. */
export function apart(a: readonly number[], b: readonly number[]): number {
  return Math.hypot(a[0]! - b[0]!, a[2]! - b[2]!);
}

/** Gives the stage the focus, so that keys reach it. */
export async function focusStage(page: Page): Promise<void> {
  await page.locator('#stage').focus();
}

/** Chooses a value of one of the panels' lists. */
export async function choose(page: Page, label: string, value: string, panel = page.locator('.side')): Promise<void> {
  await panel.getByRole('combobox', { name: label, exact: true }).click();
  await page.getByRole('option', { name: value, exact: true }).click();
}

/** Opens the courtyard without a character; the first test that comes uploads it, as a person would. */
export async function openCourtyard(page: Page, open: (link: string) => Promise<void>, more = ''): Promise<void> {
  await open(`mode=scenes&scene=courtyard&n=0${more}`);
  const upload = page.getByRole('button', { name: 'Upload the courtyard' });
  const list = page.getByRole('list', { name: 'Objects of the scene' });
  await expect(upload.or(list).first()).toBeVisible({ timeout: 45_000 });
  if (await upload.isVisible()) await upload.click();
  await expect(list).toBeVisible();
}
