// The pictures of README.md and docs/: `make pictures`. They are made, not compared.
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import type { Page } from '@playwright/test';
import { expect, focusStage, test, waitForCrowd } from './viewer';

const ROOT = resolve(import.meta.dirname, '../..');
const OUT = join(ROOT, 'docs/pictures');
/** Of the page, and of the files. */
const [WIDTH, HEIGHT] = [1360, 765];
const WIDTH_OF_FILE = 1600;
const MOST_BYTES = 150_000;
/** While time goes on the page is small: software draws it. */
const SMALL = { width: 480, height: 270 };
/** Room for the panels that a test uses. */
const MIDDLE = { width: 820, height: 560 };

/** A bench of four seats and a table, for people who sit. */
const SQUARE = `
format = 1
name = "square"
[[colliders]]
id = "table"
position_m = [2.2, 0.0, 0.6]
[colliders.shape.box]
center_m = [0.0, 0.425, 0.0]
half_extents_m = [0.4, 0.425, 0.7]
${[0, 1, 2, 3].map((nth) => `[[objects]]\nid = "bench-${nth}"\ndefinition = "seat"\nposition_m = [${(nth - 1.5) * 0.46}, 0.0, -1.2]\n`).join('')}
[[objects]]
id = "cup"
definition = "cup"
position_m = [2.0, 0.85, 0.9]
[[objects]]
id = "sign"
definition = "sign"
position_m = [-2.4, 0.0, -1.4]
heading_deg = 35.0
`;

test.use({ viewport: SMALL });
test.setTimeout(600_000);

/** Writes what the page shows as WebP, drawn at twice its size and made smaller: smooth edges. */
async function picture(page: Page, name: string): Promise<void> {
  await page.setViewportSize({ width: WIDTH, height: HEIGHT });
  const devtools = await page.context().newCDPSession(page);
  const size = { width: WIDTH, height: HEIGHT, mobile: false };
  await devtools.send('Emulation.setDeviceMetricsOverride', { ...size, deviceScaleFactor: 2 });
  await page.evaluate(() => window.dispatchEvent(new Event('resize')));
  await page.mouse.move(WIDTH / 2, 2);
  await page.waitForTimeout(6000);
  const png = await page.screenshot({ scale: 'device', animations: 'disabled', timeout: 180_000 });
  const webp = await page.evaluate(
    async ([base64, width, most]) => {
      const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
      const read = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
      const canvas = document.createElement('canvas');
      [canvas.width, canvas.height] = [width, Math.round((width * read.height) / read.width)];
      const context = canvas.getContext('2d')!;
      context.imageSmoothingQuality = 'high';
      context.drawImage(read, 0, 0, canvas.width, canvas.height);
      for (let quality = 0.92; ; quality -= 0.04) {
        const blob = await new Promise<Blob>((done) => {
          canvas.toBlob(
            (made) => {
              done(made!);
            },
            'image/webp',
            quality,
          );
        });
        if (blob.size <= most || quality < 0.5) return [...new Uint8Array(await blob.arrayBuffer())];
      }
    },
    [png.toString('base64'), WIDTH_OF_FILE, MOST_BYTES] as const,
  );
  expect(webp.length).toBeLessThanOrEqual(MOST_BYTES);
  mkdirSync(OUT, { recursive: true });
  writeFileSync(join(OUT, `${name}.webp`), Uint8Array.from(webp));
}

async function paused(page: Page): Promise<void> {
  await focusStage(page);
  await page.keyboard.press(' ');
  await expect(page.getByRole('button', { name: 'Go on (Space)' })).toBeVisible();
}

for (const theme of ['light', 'dark'] as const) {
  test(`crowd, ${theme} @pictures`, async ({ page, open }) => {
    await page.emulateMedia({ colorScheme: theme });
    await open('mode=live&n=40&cam=-2,0.3,-2.4,2.65,1.15,18.5');
    await waitForCrowd(page, 40, 240_000);
    await page.waitForTimeout(9000);
    // Yours walks too, and is in the middle of a step when time stops.
    await page.keyboard.down('d');
    await page.waitForTimeout(2500);
    await paused(page);
    await page.keyboard.up('d');
    await picture(page, theme === 'light' ? 'crowd' : 'crowd-dark');
  });
}

test('path @pictures', async ({ page, open }) => {
  await page.setViewportSize(MIDDLE);
  await open('mode=live&n=1&open=inside&cam=0.9,0.5,0,2.75,1.12,7');
  await waitForCrowd(page, 1, 120_000);
  await page.getByRole('button', { name: 'Draw a path (P)' }).click();
  const at = (share: number): [number, number] => [
    110 + 400 * share,
    310 + 80 * Math.sin(share * Math.PI * 2) + 40 * share,
  ];
  await page.mouse.move(...at(0));
  await page.mouse.down();
  for (let step = 1; step <= 60; step++) await page.mouse.move(...at(step / 60));
  await page.mouse.up();
  await expect.poll(() => page.evaluate(() => window.troupe!.path())).toBe('walking');
  await page.setViewportSize(SMALL);
  await page.waitForTimeout(4500);
  await paused(page);
  await picture(page, 'path');
});

test('sit @pictures', async ({ page, open, server }) => {
  for (const name of ['seat', 'cup', 'sign']) {
    const text = readFileSync(join(ROOT, `examples/objects/${name}.toml`), 'utf8');
    await put(`${server.api}/v1/objects/${name}`, text);
  }
  await put(`${server.api}/v1/scenes/square`, SQUARE);
  await page.setViewportSize(MIDDLE);
  const events = page.getByRole('log', { name: 'Events' });
  await open('mode=scenes&scene=square&n=0&cam=0,0.6,0.4,0.45,1.2,6.4');
  for (const seat of ['bench-0', 'bench-2']) {
    await page.getByRole('button', { name: new RegExp(`^${seat}`) }).click();
    await page.getByRole('button', { name: /^Add a(nother one| character)$/ }).click();
    await page.waitForTimeout(2500);
    await page.getByRole('button', { name: 'Use it …' }).click();
    await page.getByRole('menuitem', { name: 'upright' }).click();
    await expect(events.getByText(new RegExp(`reached sit of ${seat}`))).toBeVisible({ timeout: 120_000 });
  }
  await page.getByRole('button', { name: /^cup/ }).click();
  await page.getByRole('button', { name: /^Add a(nother one| character)$/ }).click();
  await page.waitForTimeout(2500);
  await focusStage(page);
  await page.keyboard.press('u');
  await expect(events.getByText(/took cup/)).toBeVisible({ timeout: 120_000 });
  await page.waitForTimeout(2000);
  await picture(page, 'sit');
});

test('editor @pictures', async ({ page, open }) => {
  await page.setViewportSize(MIDDLE);
  await open('mode=inbetween&clip=walk&from=30&to=72&variants=3');
  await expect.poll(() => page.evaluate(() => window.editor?.frames() ?? 0), { timeout: 120_000 }).toBeGreaterThan(65);
  await page.getByRole('button', { name: 'Fill the gap' }).click();
  await expect.poll(() => page.evaluate(() => window.editor!.variants().length), { timeout: 60_000 }).toBe(3);
  await page.getByText('Over each other').click();
  await focusStage(page);
  await page.keyboard.press('Home');
  for (let step = 0; step < 2; step++) await page.keyboard.press('Shift+ArrowRight');
  await picture(page, 'editor');
});

async function put(address: string, text: string): Promise<void> {
  const body = JSON.stringify({ document: { format: 'toml', text } });
  const answer = await fetch(address, { method: 'PUT', headers: { 'content-type': 'application/json' }, body });
  if (!answer.ok) throw new Error(`${address}: ${await answer.text()}`);
}
