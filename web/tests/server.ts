// A troupe-server for the tests, with a store of its own, and the viewer that it serves.
import type { ChildProcess } from 'node:child_process';
import { spawn } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import type { PreviewServer } from 'vite';
import { preview } from 'vite';

const ROOT = resolve(import.meta.dirname, '../..');
/** Loading three packs takes long on a busy machine, ms. */
const READY_MS = 240_000;
/** Lines of the server's log that an error shows. */
const SHOWN_LINES = 15;

/** The built server: TROUPE_SERVER, or the newest build of the repository. */
export function binary(): string {
  const asked = process.env['TROUPE_SERVER'];
  const found = (asked ? [asked] : ['release', 'debug'].map((kind) => join(ROOT, `target/${kind}/troupe-server`))).find(
    (path) => existsSync(path),
  );
  if (!found)
    throw new Error(`no troupe-server at ${asked ?? 'target/release or target/debug'}: cargo build --release`);
  return found;
}

async function freePort(): Promise<number> {
  return new Promise((done, fail) => {
    const server = createServer();
    server.on('error', fail);
    server.listen(0, '127.0.0.1', () => {
      const address = server.address();
      server.close(() => {
        if (address && typeof address === 'object') done(address.port);
        else fail(new Error('no free port'));
      });
    });
  });
}

export class TroupeServer {
  private child: ChildProcess | undefined;
  private viewer: PreviewServer | undefined;
  private readonly store = mkdtempSync(join(tmpdir(), 'troupe-web-'));
  private readonly lines: string[] = [];

  private constructor(
    private readonly port: number,
    private readonly args: readonly string[],
  ) {}

  /** Starts a server, and waits until it is ready. `args` come after the tests' own. */
  static async start(args: readonly string[] = ['--packs', join(ROOT, 'models')]): Promise<TroupeServer> {
    const server = new TroupeServer(await freePort(), args);
    await server.run();
    if (process.env['TROUPE_VIEWER'] === 'preview') await server.serveViewer();
    return server;
  }

  /** Address of the server's API. */
  get api(): string {
    return `http://127.0.0.1:${this.port}`;
  }

  /** Address of the viewer: the server's own, or with TROUPE_VIEWER=preview that of web/dist before it. */
  get page(): string {
    return this.viewer?.resolvedUrls?.local[0] ?? `${this.api}/`;
  }

  /** Processor time that the process has taken, seconds. Linux only. */
  cpuSeconds(): number {
    const stat = readFileSync(`/proc/${this.child?.pid}/stat`, 'utf8');
    // Behind the name, which may hold spaces: user and system time are the 12th and the 13th, in
    // hundredths.
    const numbers = stat.slice(stat.lastIndexOf(')') + 2).split(' ');
    return (Number(numbers[11]) + Number(numbers[12])) / 100;
  }

  /** Starts the process, with the store that is there. */
  async run(): Promise<void> {
    const runtime = join(ROOT, '.runtime/libonnxruntime.so');
    const args = ['--listen', `127.0.0.1:${this.port}`, '--store', this.store, ...this.args];
    const child = spawn(binary(), args, {
      cwd: ROOT,
      env: { ORT_DYLIB_PATH: runtime, ...process.env, NO_COLOR: '1' },
      stdio: ['ignore', 'pipe', 'pipe'],
    });
    this.child = child;
    for (const stream of [child.stdout, child.stderr]) {
      stream.on('data', (data: Buffer) => {
        this.lines.push(...data.toString().trimEnd().split('\n'));
        this.lines.splice(0, this.lines.length - SHOWN_LINES);
      });
    }
    const until = Date.now() + READY_MS;
    while (!(await this.isReady())) {
      if (child.exitCode !== null)
        throw new Error(`the server ended with ${child.exitCode}:\n${this.lines.join('\n')}`);
      if (Date.now() > until)
        throw new Error(`the server is not ready after ${READY_MS} ms:\n${this.lines.join('\n')}`);
      await new Promise((wait) => setTimeout(wait, 200));
    }
  }

  /** Ends the process, as a crash would. The store stays. */
  async kill(): Promise<void> {
    await this.end('SIGKILL');
  }

  async stop(): Promise<void> {
    await this.viewer?.close();
    await this.end('SIGTERM');
    rmSync(this.store, { recursive: true, force: true });
  }

  private async end(signal: NodeJS.Signals): Promise<void> {
    const { child } = this;
    this.child = undefined;
    if (!child || child.exitCode !== null || child.signalCode !== null) return;
    const ended = new Promise((done) => child.once('exit', done));
    child.kill(signal);
    // A server that drains does not hold the tests up.
    const timer = setTimeout(() => child.kill('SIGKILL'), 10_000);
    await ended;
    clearTimeout(timer);
  }

  private async isReady(): Promise<boolean> {
    return fetch(`${this.api}/readyz`).then(
      (answer) => answer.ok,
      () => false,
    );
  }

  /** Serves web/dist before the server. */
  private async serveViewer(): Promise<void> {
    const proxied = { target: this.api, changeOrigin: true, ws: true, headers: { origin: this.api } };
    this.viewer = await preview({
      root: join(ROOT, 'web'),
      configFile: false,
      logLevel: 'silent',
      preview: {
        host: '127.0.0.1',
        port: await freePort(),
        strictPort: true,
        proxy: { '/v1': proxied, '/metrics': proxied, '/healthz': proxied, '/readyz': proxied },
      },
    });
  }
}
