// What characters look like: people in the project's own body, capsules, and skins that are
// dropped.
import { readFileSync } from 'node:fs';
import { resolve } from 'node:path';
import AxeBuilder from '@axe-core/playwright';
import type { Page } from '@playwright/test';
import { HERO_BONES, heroGlb } from '../src/retarget/testing';
import { apart, expect, focusStage, ownPlace, test, waitForCrowd } from './viewer';

const HUMAN = resolve(import.meta.dirname, '../src/bodies/human.glb');

/** Drops files on the stage. */
async function drop(page: Page, name: string, bytes: Uint8Array, ...more: [string, Uint8Array][]): Promise<void> {
  const dataTransfer = await page.evaluateHandle(
    (files) => {
      const all = new DataTransfer();
      for (const [as, numbers] of files) all.items.add(new File([new Uint8Array(numbers)], as));
      return all;
    },
    [[name, bytes] as const, ...more].map(([as, numbers]) => [as, [...numbers]] as const),
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

test('the crowd wears a character with other joints, with its figures beside, and takes it off', async ({
  page,
  open,
  watched,
}) => {
  await open('mode=live&n=6&who=human');
  await waitForCrowd(page, 6);
  await focusStage(page);
  await page.keyboard.press('v');
  const skinned = () => page.evaluate(() => window.troupe!.ids().filter((id) => window.troupe!.isSkinned(id)).length);
  await expect.poll(skinned).toBe(0);
  await drop(page, 'hero.glb', heroGlb());
  const panel = page.getByRole('group', { name: 'hero.glb' });
  await expect(panel).toBeVisible();
  expect(await skinned()).toBe(6);
  await expect(panel.getByText(`${HERO_BONES}, the pack has 21`)).toBeVisible();
  await expect(panel.getByText(/^Drawn at the crowd’s size, 0\.\d+ times its own/)).toBeVisible();
  const table = panel.getByRole('table', { name: 'What is kept of the motion' });
  await expect(table.getByRole('row', { name: /^walk \d/ })).toBeVisible();
  const { violations } = await new AxeBuilder({ page }).include('#outfits-body').analyze();
  expect(violations.filter(({ impact }) => impact === 'serious' || impact === 'critical')).toEqual([]);
  // It moves with its character, whose place stays the server's.
  const before = await ownPlace(page);
  await page.keyboard.down('w');
  await expect.poll(async () => apart(await ownPlace(page), before), { timeout: 20_000 }).toBeGreaterThan(1);
  await page.keyboard.up('w');
  await panel.getByRole('button', { name: 'Take it off' }).click();
  await expect(panel).toHaveCount(0);
  expect(await skinned()).toBe(0);
  expect(watched.errors).toEqual([]);
});

test('a character beyond the bar is refused with the joint, and worn if that is wanted', async ({ page, open }) => {
  await open('mode=live&n=1');
  await waitForCrowd(page, 1);
  await focusStage(page);
  await page.keyboard.press('v');
  await expect.poll(() => isSkinned(page)).toBe(false);
  // Arms on the wrong sides.
  const arm = (side: string, of: string) => `[${side}_arm]
girdle = ["mixamorig:${of}Shoulder"]
upper = ["mixamorig:${of}Arm"]
lower = ["mixamorig:${of}ForeArm"]
end = "mixamorig:${of}Hand"
`;
  const parts = Buffer.from(arm('left', 'Right') + arm('right', 'Left'));
  await drop(page, 'hero.glb', heroGlb(), ['hero.toml', parts]);
  const panel = page.getByRole('group', { name: 'hero.glb' });
  await expect(panel.getByText(/walk: .*mixamorig:/).first()).toBeVisible();
  expect(await isSkinned(page)).toBe(false);
  await panel.getByRole('button', { name: 'Wear it anyway' }).click();
  await expect(panel.getByText('Worn by human')).toBeVisible();
  expect(await isSkinned(page)).toBe(true);
});
