// A stream as the page sees it: the worker behind it owns the socket.
import type { FromWorker, ToWorker } from './messages';
import type { Command } from './types';
import type { Way } from './way';

export class DriveStream {
  private readonly worker = new Worker(new URL('./drive.worker.ts', import.meta.url), { type: 'module' });

  constructor(onMessage: (message: FromWorker) => void) {
    this.worker.onmessage = ({ data }: MessageEvent<FromWorker>) => {
      onMessage(data);
    };
  }

  /** Opens the stream, in place of one that is open. A server that asks for keys needs a ticket. */
  open(ticket: string | undefined, rateHz: number, way: Way): void {
    const url = new URL('/v1/drive', location.href);
    url.protocol = url.protocol.replace('http', 'ws');
    way.mark(url);
    if (ticket) url.searchParams.set('ticket', ticket);
    this.ask({ kind: 'open', url: url.href, rate_hz: rateHz });
  }

  attach(ids: string[]): void {
    if (ids.length > 0) this.ask({ kind: 'attach', ids });
  }

  detach(ids: string[]): void {
    if (ids.length > 0) this.ask({ kind: 'detach', ids });
  }

  command(commands: Command[]): void {
    if (commands.length > 0) this.ask({ kind: 'commands', commands });
  }

  close(): void {
    this.ask({ kind: 'close' });
  }

  dispose(): void {
    this.worker.terminate();
  }

  private ask(message: ToWorker): void {
    this.worker.postMessage(message);
  }
}
