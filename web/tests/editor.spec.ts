// The in-between editor: fills a gap of a walk that the server makes, and exports it.
import { readFileSync } from 'node:fs';
import { HERO_BONES, heroGlb } from '../src/retarget/testing';
import { choose, expect, test } from './viewer';

test('fills a gap and exports it as BVH', async ({ page, open, watched }) => {
  test.setTimeout(90_000);
  await open('mode=inbetween&clip=walk&from=30&to=65');
  await expect.poll(() => page.evaluate(() => window.editor?.frames() ?? 0), { timeout: 45_000 }).toBeGreaterThan(65);
  await page.getByRole('button', { name: 'Fill the gap' }).click();
  await expect
    .poll(() => page.evaluate(() => window.editor!.variants().length), { timeout: 30_000 })
    .toBeGreaterThan(0);
  expect(await page.evaluate(() => window.editor!.trouble())).toBe('');
  const frames = await page.evaluate(() => window.editor!.frames());

  await page.getByRole('button', { name: 'Whole clip' }).click();
  const [download] = await Promise.all([
    page.waitForEvent('download'),
    page.getByRole('menuitem', { name: 'BVH' }).click(),
  ]);
  const { joints, rows, count, seconds } = readBvh(readFileSync(await download.path(), 'utf8'));
  expect(count).toBe(frames);
  expect(rows).toHaveLength(frames);
  expect(seconds).toBeCloseTo(1 / 30, 4);
  // Three numbers a joint, and the place of the first.
  for (const row of rows) expect(row.length).toBeGreaterThanOrEqual(joints * 3 + 3);
  expect(rows.flat().every(Number.isFinite)).toBe(true);
  // It walks: no two frames of the gap are alike.
  const gap = rows.slice(30, 65).map((row) => row.join(' '));
  expect(new Set(gap).size).toBe(gap.length);
  expect(watched.errors).toEqual([]);
});

test('its tools stand in a frame of their own, clear of title and timeline', async ({ page, open }) => {
  await open('mode=inbetween&clip=walk');
  await expect.poll(() => page.evaluate(() => window.editor?.frames() ?? 0), { timeout: 45_000 }).toBeGreaterThan(65);
  const tools = page.getByRole('navigation', { name: 'Tools' });
  const [frame, title, timeline] = await Promise.all(
    [tools, page.locator('.head p'), page.locator('.timeline')].map((one) => one.boundingBox()),
  );
  expect(frame!.y).toBeGreaterThan(title!.y + title!.height);
  expect(frame!.y + frame!.height).toBeLessThan(timeline!.y);
  const buttons = tools.getByRole('button');
  expect(await buttons.count()).toBe(4);
  for (const button of await buttons.all()) {
    const box = (await button.boundingBox())!;
    expect(box.x).toBeGreaterThan(frame!.x);
    expect(box.x + box.width).toBeLessThan(frame!.x + frame!.width);
    expect(box.y).toBeGreaterThan(frame!.y);
    expect(box.y + box.height).toBeLessThan(frame!.y + frame!.height);
  }
  const background = await tools.evaluate((element) => getComputedStyle(element).backgroundColor);
  expect(background).not.toBe('rgba(0, 0, 0, 0)');
});

test('says what it understood of a file', async ({ page, open, watched }) => {
  await open('mode=inbetween&clip=walk');
  await expect.poll(() => page.evaluate(() => window.editor?.frames() ?? 0), { timeout: 45_000 }).toBeGreaterThan(65);
  const input = page.locator('input[type="file"][accept*=".bvh"]');
  const table = page.getByRole('table', { name: 'What was understood of the file' });
  await expect(table).toHaveCount(0);
  await input.setInputFiles('../examples/walk.bvh');
  await expect(table.getByRole('row', { name: 'format BVH' })).toBeVisible();
  await expect(table.getByRole('row', { name: 'up axis y' })).toHaveAttribute('title', /from feet to head/);
  await input.setInputFiles({ name: 'wrong.bvh', mimeType: 'text/plain', buffer: Buffer.from('HIERARCHY ROOT a') });
  await expect(page.getByText(/wrong\.bvh: line 1: /)).toBeVisible();
  expect(watched.errors).toEqual([]);
});

test('reads a file again with the option that its error names', async ({ page, open, watched }) => {
  await open('mode=inbetween');
  const input = page.locator('input[type="file"][accept*=".bvh"]');
  await expect(input.first()).toBeAttached({ timeout: 45_000 });
  await expect(page.getByRole('combobox', { name: 'Pack' })).not.toHaveValue('', { timeout: 45_000 });
  const text = readFileSync('../examples/walk.bvh', 'utf8').replace('OFFSET 39.0811 0 0', 'OFFSET 45 0 0');
  const file = { name: 'long.bvh', mimeType: 'text/plain', buffer: Buffer.from(text) };
  await input.first().setInputFiles(file);
  await expect(page.getByText(/long\.bvh: .*--other-bones/).first()).toBeVisible();
  // The panel opens at the options that the error names.
  const options = page.getByRole('group', { name: 'How the file is read' });
  const control = (name: string) => options.getByRole('combobox', { name });
  await expect(control('Other bones')).toHaveAttribute('aria-invalid', 'true');
  await expect(control('Up axis')).not.toHaveAttribute('aria-invalid', 'true');
  await expect(control('Quaternion')).toHaveCount(0);
  await choose(page, 'Other bones', 'yes');
  await expect.poll(() => page.evaluate(() => window.editor!.frames())).toBe(120);
  expect(await page.evaluate(() => window.editor!.trouble())).toBe('');
  // Another rate gives another clip; without one, it is the file's own.
  await control('Rate, Hz').fill('15');
  await control('Rate, Hz').press('Enter');
  await expect.poll(() => page.evaluate(() => window.editor!.frames())).toBe(239);
  await control('Rate, Hz').fill('');
  await control('Rate, Hz').press('Enter');
  await expect.poll(() => page.evaluate(() => window.editor!.frames())).toBe(120);
  await page.getByRole('button', { name: 'Read long.bvh as …' }).click();
  await expect(options).toHaveCount(0);
  expect(watched.errors).toEqual([]);
});

function readBvh(text: string): { joints: number; rows: number[][]; count: number; seconds: number } {
  const [head = '', motion = ''] = text.split(/^MOTION\s*$/m);
  const count = /^Frames:\s*(\d+)/m.exec(motion);
  const seconds = /^Frame Time:\s*([\d.]+)/m.exec(motion);
  const lines = motion
    .slice(motion.indexOf(seconds?.[0] ?? '') + (seconds?.[0].length ?? 0))
    .trim()
    .split('\n');
  return {
    joints: head.match(/^\s*(?:ROOT|JOINT)\s/gm)?.length ?? 0,
    rows: lines.map((line) => line.trim().split(/\s+/).map(Number)),
    count: Number(count?.[1]),
    seconds: Number(seconds?.[1]),
  };
}

test('fills a gap on a rig of the user’s own, and exports it with its mesh', async ({ page, open, watched }) => {
  test.setTimeout(90_000);
  await open('mode=inbetween');
  const input = page.locator('input[type="file"][accept*=".bvh"]');
  await expect(page.getByRole('combobox', { name: 'Pack' })).not.toHaveValue('', { timeout: 45_000 });
  await input
    .first()
    .setInputFiles({ name: 'hero.glb', mimeType: 'model/gltf-binary', buffer: Buffer.from(heroGlb()) });
  // The server's walk, on the character.
  await expect.poll(() => page.evaluate(() => window.editor!.frames()), { timeout: 30_000 }).toBe(150);
  expect(await page.evaluate(() => window.editor!.ownJoints())).toBe(HERO_BONES);
  const own = page.getByRole('group', { name: 'Own rig' });
  await expect(own.getByRole('row', { name: /^walk \d/ })).toBeVisible();
  await page.getByRole('button', { name: 'Fill the gap' }).click();
  await expect
    .poll(() => page.evaluate(() => window.editor!.variants().length), { timeout: 30_000 })
    .toBeGreaterThan(0);
  expect(await page.evaluate(() => window.editor!.trouble())).toBe('');
  // Keyframes hold bit for bit.
  expect(await page.evaluate(() => window.editor!.missed())).toBe(0);
  await page.getByRole('button', { name: 'Whole clip' }).click();
  const [download] = await Promise.all([
    page.waitForEvent('download'),
    page.getByRole('menuitem', { name: 'glb' }).click(),
  ]);
  const written = readFileSync(await download.path());
  const file = { name: 'hero-filled.glb', mimeType: 'model/gltf-binary', buffer: written };
  expect(written.toString('latin1')).toContain('JOINTS_0');
  await input.first().setInputFiles(file);
  await expect(page.getByText(/^hero-filled\.glb: 150 frames at 30 Hz, 24 joints/)).toBeVisible();
  expect(watched.errors).toEqual([]);
});
