// What characters look like: people in the project's own body, capsules, and skins that are
// dropped.
import { readFileSync } from 'node:fs';
import { resolve } from 'node:path';
import type { Page } from '@playwright/test';
import { expect, focusStage, test, waitForCrowd } from './viewer';

const HUMAN = resolve(import.meta.dirname, '../src/bodies/human.glb');

/** Drops a file on the stage. */
async function drop(page: Page, name: string, bytes: Uint8Array): Promise<void> {
  const dataTransfer = await page.evaluateHandle(
    ([as, numbers]) => {
      const files = new DataTransfer();
      files.items.add(new File([new Uint8Array(numbers)], as));
      return files;
    },
    [name, [...bytes]] as const,
  );
  await page.dispatchEvent('#stage', 'drop', { dataTransfer });
}

const isSkinned = (page: Page) => page.evaluate(() => window.troupe!.isSkinned());

test('people wear the body, robots and animals do not, and a key switches it off', async ({ page, open, watched }) => {
  await open('mode=live&n=12');
  await waitForCrowd(page, 12);
  const skinned = () => page.evaluate(() => window.troupe!.ids().filter((id) => window.troupe!.isSkinned(id)).length);
  // Of twelve three are guests.
  await expect.poll(skinned).toBe(9);
  await focusStage(page);
  await page.keyboard.press('v');
  await expect.poll(skinned).toBe(0);
  // The choice is kept.
  await page.reload();
  await waitForCrowd(page, 12);
  expect(await skinned()).toBe(0);
  await page.getByRole('button', { name: 'Bodies or capsules (V)' }).click();
  await expect.poll(skinned).toBe(9);
  expect(watched.errors).toEqual([]);
});

test('a skin that is dropped wins, and files that are none are refused in words', async ({ page, open }) => {
  await open('mode=live&n=1');
  await waitForCrowd(page, 1);
  await focusStage(page);
  await page.keyboard.press('v');
  await expect.poll(() => isSkinned(page)).toBe(false);
  const glb = readFileSync(HUMAN);
  await drop(page, 'mine.glb', glb);
  await expect(page.getByText(/mine\.glb is the skin of human: 21 joints, \d+ triangles/)).toBeVisible();
  expect(await isSkinned(page)).toBe(true);
  await drop(page, 'broken.glb', glb.subarray(0, 1000));
  await expect(page.getByText(/not a glb that can be read/)).toBeVisible();
  await drop(page, 'clip.bvh', new Uint8Array([1]));
  await expect(page.getByText(/clip\.bvh: is not a glb/)).toBeVisible();
  expect(await isSkinned(page)).toBe(true);
});
