// Going from one mode to another and back: no error, the same choices, and the character in the picture.
import { apart, expect, focusStage, isInSight, ownPlace, switchMode, test, waitForCrowd } from './viewer';

test('goes through all modes and back without an error, and keeps what was chosen', async ({ page, open, watched }) => {
  test.setTimeout(120_000);
  const failed: string[] = [];
  page.on('response', (answer) => {
    if (answer.status() >= 400) failed.push(`${answer.status()} ${answer.url()}`);
  });
  await open('mode=live&n=3&style=elderly');
  await waitForCrowd(page, 3);
  await expect(page).toHaveURL(/style=elderly/);
  for (const mode of ['Scenes', 'In-between'] as const) {
    await switchMode(page, mode);
    await expect(page).toHaveURL(mode === 'Scenes' ? /mode=scenes/ : /mode=inbetween/);
    await switchMode(page, 'Live');
    await waitForCrowd(page, 3);
    await expect(page.getByText('3 live characters')).toBeVisible();
    await expect(page).toHaveURL(/mode=live.*style=elderly/);
    expect(await isInSight(page)).toBe(true);
  }
  // Long enough for the panels to ask for the styles of the crowd.
  await page.waitForTimeout(1500);
  await expect(page.locator('.notice[data-kind="error"]')).toHaveCount(0);
  expect(failed).toEqual([]);
  expect(watched.errors).toEqual([]);
});

test('time goes on after a mode was left in a pause', async ({ page, open }) => {
  await open('mode=live&n=1');
  await waitForCrowd(page, 1);
  await focusStage(page);
  await page.keyboard.press(' ');
  await expect(page.getByRole('button', { name: 'Go on (Space)' })).toBeVisible();
  await switchMode(page, 'In-between');
  await switchMode(page, 'Live');
  await waitForCrowd(page, 1);
  await expect(page.getByRole('button', { name: 'Pause (Space)' })).toBeVisible();
});

test('an address without the name of the crowd is a mixed one', async ({ page, open, watched }) => {
  await open('mode=live&n=3&who=&pack=');
  await waitForCrowd(page, 3);
  await expect(page).toHaveURL(/who=mixed/);
  expect(watched.errors).toEqual([]);
});

test('the camera comes along when the character has walked out of the picture', async ({ page, open }) => {
  // Close by, and looking down: a few steps leave the picture.
  await open('mode=live&n=1&cam=0,0.7,0,3.14,0.6,5');
  await waitForCrowd(page, 1);
  await focusStage(page);
  const before = await ownPlace(page);
  await page.keyboard.down('w');
  await expect.poll(async () => apart(await ownPlace(page), before), { timeout: 30_000 }).toBeGreaterThan(5);
  await page.keyboard.up('w');
  await expect.poll(() => isInSight(page)).toBe(true);
});

test('C finds the character, Home shows the start', async ({ page, open }) => {
  await open('mode=live&n=1');
  await waitForCrowd(page, 1);
  expect(await isInSight(page)).toBe(true);
  await focusStage(page);
  await page.keyboard.press('Home');
  const [width, height] = [1024, 640];
  // The second button moves the camera: the character stands, so the camera stays away.
  for (let i = 0; i < 3; i++) {
    await page.mouse.move(width * 0.1, height * 0.5);
    await page.mouse.down({ button: 'right' });
    await page.mouse.move(width * 0.65, height * 0.5, { steps: 4 });
    await page.mouse.up({ button: 'right' });
  }
  await expect.poll(() => isInSight(page)).toBe(false);
  await page.waitForTimeout(1000);
  expect(await isInSight(page)).toBe(false);
  await page.getByRole('button', { name: 'Find your character (C)' }).hover();
  await page.keyboard.press('c');
  await expect.poll(() => isInSight(page)).toBe(true);
});

test('a character that begins far from what the address shows comes into the picture', async ({ page, open }) => {
  await open('mode=live&n=1&cam=60,0.7,60,3.14,1.2,6');
  await waitForCrowd(page, 1);
  await expect.poll(() => isInSight(page)).toBe(true);
});
