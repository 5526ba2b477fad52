// The in-between editor: fills a gap of a walk that the server makes, and exports it.
import { readFileSync } from 'node:fs';
import { expect, test } from './viewer';

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
