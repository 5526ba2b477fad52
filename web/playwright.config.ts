// Tests of the whole viewer: a browser, and a real server that the tests start (tests/server.ts).
import { defineConfig } from '@playwright/test';

/** Software WebGL: the same pictures on every machine, with or without a GPU. */
const WEBGL = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];

export default defineConfig({
  testDir: 'tests',
  // One server and one browser at a time: what is measured has the machine for itself.
  workers: 1,
  fullyParallel: false,
  timeout: 60_000,
  globalTimeout: 20 * 60_000,
  retries: process.env['CI'] === undefined ? 0 : 2,
  expect: {
    timeout: 15_000,
    toHaveScreenshot: { maxDiffPixelRatio: 0.02, threshold: 0.25, animations: 'disabled' },
  },
  snapshotPathTemplate: '{testDir}/pictures/{arg}{ext}',
  outputDir: '../target/web-tests',
  reporter: [['list']],
  forbidOnly: process.env['CI'] !== undefined,
  use: {
    viewport: { width: 1024, height: 640 },
    deviceScaleFactor: 1,
    locale: 'en-GB',
    colorScheme: 'light',
    reducedMotion: 'reduce',
    trace: 'retain-on-failure',
    launchOptions: {
      executablePath: process.env['CHROMIUM'] ?? '/usr/bin/chromium',
      args: [...WEBGL, '--no-sandbox', '--disable-background-timer-throttling', '--disable-renderer-backgrounding'],
    },
  },
});
