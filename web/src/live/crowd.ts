// The characters of the page and their frames: opens sessions, streams them, and takes them up
// again after a break.
import type { Api } from '../wire/api';
import { ApiError } from '../wire/api';
import { decodeBlock, fromBase64 } from '../wire/codec';
import type { DecodedBlock } from '../wire/codec';
import type { FromWorker, TickMessage } from '../wire/messages';
import { DriveStream } from '../wire/stream';
import type { Command, CommandResult, SessionEvents, SessionOptions, SessionProblem } from '../wire/types';
import { isElsewhere, mayPass } from '../wire/way';
import type { Bodies } from './bodies';
import type { Role } from './cast';
import { Character } from './character';
import { PlaybackClock, RATE_HZ } from './playback';

/** Lifetime of a session that is not advanced, ms. */
const TTL_MS = 60_000;
/** Waits between tries to come back, ms: the first and the longest. */
const PAUSE_MS = [100, 500] as const;
/** Time until a session that another caller held is asked for again, ms. */
const BUSY_MS = 150;

export interface CrowdHooks {
  /** The stream is there, or gone. */
  onConnection(state: 'live' | 'reconnecting', why: string): void;
  onEvents(events: SessionEvents[]): void;
  /** Something is wrong; `session` and `sequence` name the command, if it was one. */
  onProblem(text: string, session?: string, sequence?: number): void;
  onTick(message: TickMessage): void;
  /** The characters have new sessions: their commands are lost. */
  onRestored(characters: Character[]): void;
}

export interface Opening {
  role: Role;
  x: number;
  z: number;
  heading: number;
  seed: number;
  priority: number;
  tint: number;
}

export class Crowd {
  readonly clock = new PlaybackClock();
  readonly all = new Map<string, Character>();
  private readonly bySession = new Map<string, Character>();
  private bySlot: (Character | undefined)[] = [];
  private readonly stream: DriveStream;
  private made = 0;
  /** Time of the stream's tick 0 on the clock; set by its first tick. */
  private base: number | undefined;
  private state: 'closed' | 'opening' | 'open' | 'broken' = 'closed';
  private whyBroken = '';
  /** The page steps the sessions by itself. */
  private ownClock = false;
  private stepping = false;
  private disposed = false;

  constructor(
    private readonly api: Api,
    private readonly bodies: Bodies,
    private readonly hooks: CrowdHooks,
  ) {
    this.stream = new DriveStream((message) => {
      this.hear(message);
    });
  }

  async connect(): Promise<void> {
    this.state = 'opening';
    this.stream.open(await this.api.ticket(), RATE_HZ, this.api.way);
  }

  /** Opens sessions and takes them onto the stream. */
  async open(openings: readonly Opening[]): Promise<Character[]> {
    const sessions = await this.api.createSessions(openings.map(optionsOf));
    const kinds = await Promise.all(openings.map(({ role }) => this.bodies.of(role.pack, role.body)));
    const characters = sessions.map((session, i) => {
      const { role, tint } = openings[i]!;
      const made = new Character(`c${this.made++}`, session.id, kinds[i]!, { ...role, style: session.style }, tint);
      this.all.set(made.id, made);
      this.bySession.set(session.id, made);
      return made;
    });
    if (this.state === 'open' && !this.ownClock) this.stream.attach(sessions.map((session) => session.id));
    return characters;
  }

  /** Takes characters away and closes their sessions. */
  close(characters: readonly Character[]): void {
    for (const one of characters) {
      this.all.delete(one.id);
      this.bySession.delete(one.session);
      if (one.slot !== undefined) this.bySlot[one.slot] = undefined;
      // A session that cannot be closed now expires.
      void this.api.closeSession(one.session).catch(() => undefined);
    }
  }

  command(commands: Command[]): void {
    if (commands.length === 0) return;
    if (this.ownClock) void this.api.commands(commands).then(this.reportRefused, this.complain);
    else this.stream.command(commands);
  }

  /** Whether the page's clock advances the sessions, instead of the server's. */
  get isOwnClock(): boolean {
    return this.ownClock;
  }

  /** Takes the sessions off the stream, to be stepped by the page; or gives them back. */
  setOwnClock(own: boolean): void {
    if (own === this.ownClock) return;
    this.ownClock = own;
    // Ticks that went by meanwhile do not count as the characters' time.
    this.base = undefined;
    const ids = [...this.bySession.keys()];
    if (own) this.stream.detach(ids);
    else if (this.state === 'open') this.reattach();
  }

  /** Advances all characters by one frame. Does nothing while a step is on its way. */
  async step(): Promise<void> {
    if (!this.ownClock || this.stepping || this.state !== 'open') return;
    this.stepping = true;
    try {
      const ids = [...this.bySession.keys()];
      const answer = await this.api.step(ids, []);
      const time = this.clock.newest + 1 / RATE_HZ;
      for (const block of answer.blocks) {
        const decoded = decodeBlock({
          pack: block.pack,
          body: block.body,
          slots: block.slots,
          frames: block.first_frames.map(Number),
          roots: fromBase64(block.packed_roots),
          rotations: fromBase64(block.packed_rotations),
          contacts: fromBase64(block.contacts),
        });
        this.take(decoded, time, (slot) => this.bySession.get(ids[slot] ?? ''));
      }
      this.clock.push(time);
      this.base = undefined;
      if (answer.events.length > 0) this.hooks.onEvents(answer.events);
    } catch (error) {
      // Right after the change of clocks the stream may still hold the sessions.
      if (!(error instanceof ApiError && error.reason === 'SESSION_BUSY')) this.complain(error);
    } finally {
      this.stepping = false;
    }
  }

  /** Keeps sessions alive while they are not advanced: any command does, even one that changes nothing. */
  keepAlive(): void {
    if (!this.ownClock || this.all.size === 0) return;
    this.command([...this.all.values()].map((one) => one.signOfLife()));
  }

  characterOf(session: string): Character | undefined {
    return this.bySession.get(session);
  }

  dispose(): void {
    this.disposed = true;
    this.close([...this.all.values()]);
    this.stream.close();
    this.stream.dispose();
  }

  private hear(message: FromWorker): void {
    switch (message.kind) {
      case 'opened':
        this.state = 'open';
        this.base = undefined;
        this.bySlot = [];
        if (!this.ownClock) this.reattach();
        this.hooks.onConnection('live', '');
        break;
      case 'tick':
        this.tick(message);
        break;
      case 'attached':
        for (const { session_id, slot } of message.sessions) {
          const character = this.bySession.get(session_id);
          if (!character) continue;
          character.slot = slot;
          this.bySlot[slot] = character;
        }
        this.attachLater(message.problems.filter(comesSoon));
        void this.mend(message.problems.filter((one) => !mayPass(one.problem?.reason)));
        this.goAfter(message.problems);
        break;
      case 'left':
        this.goAfter(message.sessions);
        void this.mend(message.sessions.filter((one) => one.problem?.reason === 'SESSION_EXPIRED'));
        break;
      case 'refused':
        this.reportRefused(message);
        break;
      case 'events':
        this.hooks.onEvents(message.sessions);
        break;
      case 'closing':
        this.whyBroken = message.reason.reason === 'DRAINING' ? 'the server is stopping' : message.reason.message;
        break;
      case 'closed':
        void this.comeBack(this.whyBroken || message.reason || 'the connection broke');
    }
  }

  private tick(message: TickMessage): void {
    if (this.ownClock) return;
    const step = 1 / RATE_HZ;
    this.base ??= this.clock.newest + step - message.tick * step;
    const time = this.base + message.tick * step;
    for (const block of message.blocks) this.take(block, time, (slot) => this.bySlot[slot]);
    this.clock.push(time);
    this.hooks.onTick(message);
  }

  private take(block: DecodedBlock, time: number, whose: (slot: number) => Character | undefined): void {
    for (let place = 0; place < block.slots.length; place++) {
      whose(block.slots[place]!)?.track.push(time, block, place);
    }
  }

  private reattach(): void {
    this.stream.attach([...this.bySession.keys()]);
  }

  private attachLater(busy: readonly SessionProblem[]): void {
    if (busy.length === 0) return;
    setTimeout(() => {
      if (this.state === 'open' && !this.ownClock) this.stream.attach(busy.map((one) => one.session_id));
    }, BUSY_MS);
  }

  /** Goes to the server that has sessions of the page now. */
  private goAfter(problems: readonly SessionProblem[]): void {
    const away = problems.find((one) => isElsewhere(one.problem?.reason));
    if (!away?.problem) return;
    this.api.way.follow(away.problem);
    this.stream.close();
    void this.comeBack(away.problem.message, true);
  }

  /** Opens the stream again, and takes up its sessions where the page saw them last. */
  private async comeBack(why: string, knowsWhere = false): Promise<void> {
    if (this.disposed || this.state === 'broken') return;
    this.state = 'broken';
    this.whyBroken = '';
    this.hooks.onConnection('reconnecting', why);
    // Without a word from a server, the router decides.
    if (!knowsWhere) this.api.way.forget();
    for (let pause: number = PAUSE_MS[0]; !this.isDisposed(); pause = Math.min(pause * 2, PAUSE_MS[1])) {
      await new Promise((done) => setTimeout(done, pause));
      try {
        await this.takeUp();
        this.state = 'opening';
        this.stream.open(await this.api.ticket(), RATE_HZ, this.api.way);
        return;
      } catch (error) {
        // The server that was named may be the one that is lost.
        if (error instanceof ApiError && error.status >= 502) this.api.way.forget();
        if (!(error instanceof ApiError && (error.mayPass || error.status === 429))) this.complain(error);
      }
    }
  }

  private isDisposed(): boolean {
    return this.disposed;
  }

  private async takeUp(): Promise<void> {
    const seen = [...this.all.values()].map((one) => {
      const [frame, pose] = [one.track.frame, one.lastFrame()];
      return { session_id: one.session, ...(frame === undefined || !pose ? {} : { frame, pose }) };
    });
    if (seen.length === 0) return;
    const { sessions, problems } = await this.api.resumeSessions(seen);
    const passing = problems.find((one) => mayPass(one.problem?.reason))?.problem;
    if (passing) {
      // Its old server has a lease of it, or has not noticed that the old stream is gone, or the
      // store does not answer. Sessions that are here already keep the page here.
      if (sessions.length === 0) this.api.way.follow(passing);
      throw new ApiError(passing.message, 0, passing.reason);
    }
    for (const { session } of sessions) {
      if (session) this.bySession.get(session.id)?.seen(Number(session.last_sequence));
    }
    await this.mend(problems);
  }

  /** Replaces sessions that are gone by new ones at the places of their characters. */
  private async mend(problems: readonly SessionProblem[]): Promise<void> {
    const gone = problems.flatMap((problem) => this.bySession.get(problem.session_id) ?? []);
    if (gone.length === 0) return;
    try {
      const made = await this.api.createSessions(gone.map((one, i) => optionsOf(openingOf(one, i))));
      made.forEach((session, i) => {
        const one = gone[i]!;
        this.bySession.delete(one.session);
        one.session = session.id;
        this.bySession.set(session.id, one);
      });
      if (this.state === 'open' && !this.ownClock) this.stream.attach(made.map((session) => session.id));
      this.hooks.onRestored(gone);
    } catch (error) {
      if (this.state !== 'open') throw error;
      this.complain(error);
    }
  }

  private readonly reportRefused = ({ results }: { results: CommandResult[] }): void => {
    for (const { problem, session_id, sequence } of results)
      if (problem) this.hooks.onProblem(problem.message, session_id, Number(sequence));
  };

  private readonly complain = (error: unknown): void => {
    this.hooks.onProblem(error instanceof Error ? error.message : String(error));
  };
}

function optionsOf({ role, x, z, heading, seed, priority }: Opening): SessionOptions {
  return { ...role, position: { x, y: 0, z }, heading, seed: String(seed), priority, ttl_ms: TTL_MS };
}

/** A step has it for a moment, or the store does not answer. */
function comesSoon({ problem }: SessionProblem): boolean {
  return mayPass(problem?.reason) && !isElsewhere(problem?.reason);
}

function openingOf(one: Character, seed: number): Opening {
  const [x, z] = [one.root[0]!, one.root[2]!];
  return { role: one.role, x, z, heading: one.moving ?? 0, seed, priority: 0.5, tint: one.tint };
}
