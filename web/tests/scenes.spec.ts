// The scenes mode: the example courtyard, a stool to sit on, a cup to carry, objects to move.
import type { Page } from '@playwright/test';
import { resolve } from 'node:path';
import { apart, expect, focusStage, openCourtyard, test } from './viewer';

const EXAMPLES = resolve(import.meta.dirname, '../../examples');

async function putCharacter(page: Page): Promise<void> {
  await page.getByRole('button', { name: 'Add a character' }).click();
  await expect.poll(() => page.evaluate(() => window.troupeScenes?.position() !== undefined)).toBe(true);
}

test('sits down on a stool, and rises', async ({ page, open, watched }) => {
  test.setTimeout(90_000);
  await openCourtyard(page, open);
  await page.getByRole('button', { name: /^stool/ }).click();
  await putCharacter(page);
  const standing = (await page.evaluate(() => window.troupeScenes!.position()))![1];
  await page.getByRole('button', { name: 'Use it …' }).click();
  await page.getByRole('menuitem', { name: 'upright' }).click();
  const events = page.getByRole('log', { name: 'Events' });
  await expect(events.getByText(/started upright at stool/)).toBeVisible();
  await expect(events.getByText(/reached sit of stool/)).toBeVisible({ timeout: 40_000 });
  // The hips come down to the seat.
  const height = async () => (await page.evaluate(() => window.troupeScenes!.position()))![1];
  await expect.poll(height).toBeLessThan(standing - 0.3);
  await expect(page.getByRole('button', { name: /^stool.*reserved/ })).toBeVisible();
  await focusStage(page);
  await page.keyboard.press('x');
  await expect(events.getByText(/done with stool/)).toBeVisible({ timeout: 20_000 });
  await expect.poll(height).toBeGreaterThan(standing - 0.1);
  await expect(events.getByText(/^\d+\.\d s/).first()).toBeVisible();
  await expect(events.getByText(/^frame \d+$/).first()).toBeVisible();
  expect(watched.errors).toEqual([]);
});

test('carries a cup: it moves with the hand, and stays at the place of its release', async ({ page, open }) => {
  test.setTimeout(90_000);
  await openCourtyard(page, open, '&sel=cup-1');
  await putCharacter(page);
  const place = () =>
    page.evaluate(() => {
      const { x, y, z } = window.troupeScenes!.drawn('cup-1')!.position;
      return [x, y, z];
    });
  const before = await place();
  await focusStage(page);
  await page.keyboard.press('u');
  const events = page.getByRole('log', { name: 'Events' });
  await expect(events.getByText(/took cup-1/)).toBeVisible({ timeout: 40_000 });
  await expect(events.getByText(/reached .*lift of cup-1/)).toBeVisible({ timeout: 20_000 });
  await focusStage(page);
  await page.keyboard.down('w');
  await expect.poll(async () => apart(await place(), before), { timeout: 20_000 }).toBeGreaterThan(1.2);
  await page.keyboard.up('w');
  const root = await page.evaluate(() => window.troupeScenes!.position()!);
  expect(apart(await place(), root)).toBeLessThan(0.8);
  await page.keyboard.press('g');
  await expect(events.getByText(/put down cup-1/)).toBeVisible({ timeout: 15_000 });
  await expect(page.getByRole('button', { name: 'cup-1 cup', exact: true })).toBeVisible();
  const served = await page.evaluate(() => window.troupeScenes!.objects().find(({ id }) => id === 'cup-1')!);
  await expect.poll(async () => apart(await place(), Object.values(served.position!))).toBeLessThan(0.01);
  // On what is below, no longer at the height of the hand.
  await expect.poll(async () => Math.abs((await place())[1]! - served.position!.y)).toBeLessThan(0.01);
  expect(served.position!.y).toBeLessThan(0.9);
});

test('puts an object down, moves it by number, and takes it out', async ({ page, open, server }) => {
  await openCourtyard(page, open);
  const onServer = async (id: string) => {
    const answer = await fetch(`${server.api}/v1/scenes/courtyard?without_colliders=true`);
    const { objects } = (await answer.json()) as {
      objects: { id: string; position: { x: number; y: number; z: number } }[];
    };
    return objects.find((object) => object.id === id)?.position;
  };
  await page.getByRole('combobox', { name: 'Another object' }).click();
  await page.getByRole('option', { name: 'sign', exact: true }).click();
  await page.getByRole('button', { name: 'In the middle' }).click();
  await expect.poll(() => page.evaluate(() => window.troupeScenes!.chosen())).toBe('sign-1');
  await page.getByLabel('x (m)').fill('1.25');
  await page.getByLabel('x (m)').press('Enter');
  await expect.poll(async () => (await onServer('sign-1'))?.x).toBe(1.25);
  // The fields are made again for the object's new place.
  await expect.poll(() => page.evaluate(() => window.troupeScenes!.drawn('sign-1')!.position.x)).toBe(1.25);
  await page.waitForTimeout(300);
  // A place beyond what is allowed: the server's words, with the field.
  await page.getByLabel('x (m)').fill('20000');
  await page.getByLabel('x (m)').press('Enter');
  await expect(page.getByText(/moves\[0\]\.position\.x.*-10000 to 10000/)).toBeVisible();
  expect((await onServer('sign-1'))?.x).toBe(1.25);
  await focusStage(page);
  await page.keyboard.press('Delete');
  await expect.poll(() => onServer('sign-1')).toBeUndefined();
});

test('takes dropped definitions, and says what is wrong with one', async ({ page, open }) => {
  await openCourtyard(page, open);
  const { readFileSync } = await import('node:fs');
  const text = readFileSync(`${EXAMPLES}/objects/cup.toml`, 'utf8');
  const drop = async (name: string, content: string) => {
    const transfer = await page.evaluateHandle(
      ([file, of]) => {
        const data = new DataTransfer();
        data.items.add(new File([of], file));
        return data;
      },
      [name, content] as const,
    );
    await page.dispatchEvent('body', 'drop', { dataTransfer: transfer });
  };
  await drop('mug.toml', text.replace('name = "cup"', 'name = "mug"'));
  await expect(page.getByText('Objects of mug can be placed.')).toBeVisible();
  await drop('mug.toml', text.replace('name = "cup"', 'name = "mug"').replace(/reach_m = .*/, 'reach_m = 60'));
  await expect(page.getByText(/trigger\.reach_m: is 60; allowed: 0 to 10/)).toBeVisible();
});
