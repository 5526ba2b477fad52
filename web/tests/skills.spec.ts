// Skills of the own character. But for the last test they are two small ones of a robot, written
// here: its hips go down and up.
import { mkdirSync, mkdtempSync, readdirSync, rmSync, symlinkSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import AxeBuilder from '@axe-core/playwright';
import type { Page } from '@playwright/test';
import { TroupeServer } from './server';
import { apart, choose, expect, focusStage, ownPlace, test as base, waitForCrowd } from './viewer';

const ROOT = resolve(import.meta.dirname, '../..');

/** Heights of the hips, metres: where the skills go, where it stands, and what is clearly below that. */
const LOW_M = 0.55;
const STANDS_M = 0.78;
const BELOW_M = 0.65;

const keyframe = (height: number) => `keyframes = [{ height_m = ${height}, heading_deg = 0.0, from_ground = true }]`;

const SKILLS = {
  bob: `
format = 1
name = "bob"
description = "Goes down and up."
variants = [{ name = "once", entry = "down" }]
[[sets]]
name = "down"
next = "up"
frames = 20
${keyframe(LOW_M)}
[[sets]]
name = "up"
frames = 20
${keyframe(STANDS_M)}
`,
  duck: `
format = 1
name = "duck"
description = "Goes down, and up when it is ended."
variants = [{ name = "low", entry = "half", exit = "up" }]
[[sets]]
name = "half"
next = "down"
frames = 16
${keyframe((LOW_M + STANDS_M) / 2)}
[[sets]]
name = "down"
frames = 16
hold_until_ended = true
${keyframe(LOW_M)}
[[sets]]
name = "up"
frames = 20
${keyframe(STANDS_M)}
`,
};

/** A server with people, and a robot that has the skills above. */
const test = base.extend<object, { skilled: TroupeServer }>({
  skilled: [
    // eslint-disable-next-line no-empty-pattern
    async ({}, use) => {
      const folder = mkdtempSync(join(tmpdir(), 'troupe-skills-'));
      symlinkSync(join(ROOT, 'models/human'), join(folder, 'human'));
      const robot = join(ROOT, 'models/g1');
      mkdirSync(join(folder, 'g1/skills'), { recursive: true });
      for (const name of readdirSync(robot).filter((one) => one !== 'skills'))
        symlinkSync(join(robot, name), join(folder, 'g1', name));
      for (const [name, text] of Object.entries(SKILLS)) writeFileSync(join(folder, `g1/skills/${name}.toml`), text);
      const server = await TroupeServer.start(['--packs', folder]);
      await use(server);
      await server.stop();
      rmSync(folder, { recursive: true, force: true });
    },
    { scope: 'worker', timeout: 300_000 },
  ],
});

const skills = (page: Page) => page.getByRole('group', { name: 'Skills' });
const button = (page: Page, name: string) => skills(page).getByRole('button', { name });
const status = (page: Page) => page.getByRole('status', { name: 'Skill' });
const height = async (page: Page) => (await ownPlace(page))[1];

async function openRobot(page: Page, server: TroupeServer): Promise<void> {
  await page.goto(`${server.page}#mode=live&n=1&pack=g1`);
  await waitForCrowd(page, 1);
}

/** Has it duck, and waits until it is down. */
async function duck(page: Page): Promise<void> {
  await button(page, 'duck').click();
  await expect(status(page)).toContainText('Holds “duck”', { timeout: 30_000 });
  await expect.poll(() => height(page)).toBeLessThan(BELOW_M);
}

test('does a skill, and says so', async ({ page, skilled, watched }) => {
  await openRobot(page, skilled);
  await expect(skills(page).getByRole('button')).toHaveText(['bob', 'duck · held']);
  await expect(button(page, 'bob')).toHaveAttribute('title', 'Goes down and up.');
  const before = await height(page);
  await button(page, 'bob').click();
  await expect(status(page)).toHaveText('Does “bob”', { timeout: 30_000 });
  // It is down for half a second: a slow poll may miss that.
  await expect.poll(() => height(page), { timeout: 20_000, intervals: [50] }).toBeLessThan(BELOW_M);
  await expect(status(page)).toBeEmpty({ timeout: 20_000 });
  await expect.poll(() => height(page)).toBeGreaterThan(before - 0.05);
  expect(watched.errors).toEqual([]);
});

test('holds a skill until it walks, all by keys', async ({ page, skilled }) => {
  await openRobot(page, skilled);
  await button(page, 'bob').focus();
  await page.keyboard.press('Tab');
  await expect(button(page, 'duck')).toBeFocused();
  await page.keyboard.press('Enter');
  await expect(status(page)).toContainText('Holds “duck” until it walks', { timeout: 30_000 });
  await expect(button(page, 'duck')).toHaveAttribute('aria-pressed', 'true');
  for (const scheme of ['light', 'dark'] as const) {
    await page.emulateMedia({ colorScheme: scheme });
    await page.screenshot({ path: `../target/web-tests/skills-${scheme}.png` });
    await expect
      .poll(async () =>
        (await new AxeBuilder({ page }).include('#player-body').analyze()).violations.map(({ id }) => id),
      )
      .toEqual([]);
  }
  expect(await height(page)).toBeLessThan(BELOW_M);
  await focusStage(page);
  const before = await ownPlace(page);
  await page.keyboard.down('w');
  await expect(status(page)).toHaveText('Leaves “duck”', { timeout: 20_000 });
  await expect.poll(async () => apart(await ownPlace(page), before), { timeout: 30_000 }).toBeGreaterThan(1);
  await page.keyboard.up('w');
  await expect(status(page)).toBeEmpty();
  await expect(button(page, 'duck')).toHaveAttribute('aria-pressed', 'false');
  expect(await height(page)).toBeGreaterThan(BELOW_M);
});

test('leaves a held skill by its button, or for another one', async ({ page, skilled }) => {
  await openRobot(page, skilled);
  await duck(page);
  await button(page, 'duck').click();
  await expect(status(page)).toHaveText('Leaves “duck”', { timeout: 20_000 });
  await expect(status(page)).toBeEmpty({ timeout: 20_000 });
  expect(await height(page)).toBeGreaterThan(BELOW_M);
  await duck(page);
  await button(page, 'bob').click();
  await expect(status(page)).toContainText('Then does “bob”');
  await expect(status(page)).toHaveText('Does “bob”', { timeout: 20_000 });
  await expect(status(page)).toBeEmpty({ timeout: 20_000 });
});

test('does a skill while the page keeps the time', async ({ page, skilled }) => {
  await openRobot(page, skilled);
  await focusStage(page);
  await page.keyboard.press(' ');
  await button(page, 'bob').click();
  await expect(status(page)).toHaveText('Is about to do “bob”');
  await focusStage(page);
  // The stream may still hold the session for the first steps.
  await expect(async () => {
    await page.keyboard.press('.');
    await expect(status(page)).toHaveText('Does “bob”', { timeout: 500 });
  }).toPass();
});

test('says why a skill is refused', async ({ page, skilled }) => {
  // A skill that the page knows and the server does not, as after a restart with other packs.
  await page.route('**/v1/packs/g1', async (route) => {
    const pack = (await (await route.fetch()).json()) as { skills: object[] };
    pack.skills.push({ name: 'fly', description: '', variants: [], held: false });
    await route.fulfill({ json: pack });
  });
  await openRobot(page, skilled);
  await button(page, 'fly').click();
  await expect(page.getByText('pack g1 has no skill "fly"')).toBeVisible();
  await expect(status(page)).toBeEmpty();
});

test('shows no skills where the pack has none', async ({ page, skilled }) => {
  await openRobot(page, skilled);
  await expect(skills(page)).toBeVisible();
  await choose(page, 'Pack', 'human');
  await expect(skills(page)).toHaveCount(0);
  await expect(page.locator('#player-body').getByRole('combobox', { name: 'Style' })).toBeVisible();
});

test('lies down and gets up by the trained pack', async ({ page, server }) => {
  await openRobot(page, server);
  await button(page, 'lie-down').click();
  await expect(status(page)).toContainText('Holds “lie-down”', { timeout: 40_000 });
  await expect.poll(() => height(page)).toBeLessThan(0.3);
  await button(page, 'lie-down').click();
  await expect(status(page)).toBeEmpty({ timeout: 40_000 });
  await expect.poll(() => height(page)).toBeGreaterThan(0.7);
});
