// The documentation at /docs. That no page asks anybody else is what all tests here look at
// (viewer.ts).
import AxeBuilder from '@axe-core/playwright';
import { expect, test } from './viewer';

test('the documentation loads, and its search finds a word', async ({ page, server, watched }) => {
  await page.goto(`${server.api}/docs`);
  await expect(page, 'the server was built without the site: make docs').toHaveTitle(/Troupe$/);
  for (const section of ['Start', 'Tutorials', 'Use it', 'Run it', 'Reference', 'How good and how fast', 'Design'])
    await expect(page.getByRole('navigation').getByRole('link', { name: section, exact: true }).first()).toBeVisible();

  await page.getByRole('button', { name: 'Search' }).first().click();
  await page.getByRole('combobox', { name: 'Search' }).fill('underruns');
  await page.getByRole('option').first().click();
  await expect(page).toHaveURL(/\/docs\/.+\.html\?h=underruns/);
  await expect(
    page
      .getByRole('article')
      .getByText(/underruns/)
      .first(),
  ).toBeVisible();
  expect(watched.errors).toEqual([]);
});

for (const theme of ['light', 'dark'] as const) {
  test(`a tutorial fits a phone and has no serious fault of access, ${theme}`, async ({ page, server, watched }) => {
    await page.setViewportSize({ width: 390, height: 800 });
    await page.emulateMedia({ colorScheme: theme });
    await page.goto(`${server.api}/docs/tutorials/robot.html`);
    await expect(page.getByRole('heading', { level: 1 })).toHaveText(/A robot at 50 Hz/);
    expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(390);
    const { violations } = await new AxeBuilder({ page }).include('article').analyze();
    const serious = violations.filter(({ impact }) => impact === 'serious' || impact === 'critical');
    expect(serious.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html).join(' | ')}`)).toEqual([]);
    expect(watched.errors).toEqual([]);
  });
}
