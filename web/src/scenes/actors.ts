// The characters that live in the scene: opened, steered by keys, and sent to objects.
import type { Stage } from '../stage/types';
import type { Api } from '../wire/api';
import type { TickMessage } from '../wire/messages';
import type { Intent, Locomote, SessionEvents } from '../wire/types';
import type { Bodies } from '../live/bodies';
import { runningSpeed } from '../live/bodies';
import type { Character } from '../live/character';
import { Controls, velocityOf } from '../live/control';
import { Crowd } from '../live/crowd';
import { RATE_HZ } from '../live/playback';
import { notice } from '../live/store';
import { HeldTrack } from './held';
import { describe } from './log';
import { log, useScenes } from './store';

/** Least time between commands by keys, ms. */
const COMMAND_MS = 80;
const SEED = 31;

export interface ActorHooks {
  /** The stream is there again. */
  onLive(): void;
  /** An object may have another place or holder. */
  onChange(): void;
}

export class Actors {
  readonly crowd: Crowd;
  /** Objects in hands, by id. */
  readonly held = new Map<string, HeldTrack>();
  private readonly controls = new Controls();
  private opened = 0;
  /** What characters do as soon as they are on the stage, by id. */
  private readonly first = new Map<string, Intent>();
  /** The last command of the keys, as JSON; empty when the next one must be sent in any case. */
  private sent = '';
  private sentAt_ms = 0;
  private hadWish = false;

  constructor(
    private readonly stage: Stage,
    private readonly api: Api,
    private readonly bodies: Bodies,
    private readonly hooks: ActorHooks,
  ) {
    this.crowd = new Crowd(api, bodies, {
      onConnection: (connection, trouble) => {
        useScenes.setState({ connection, trouble });
        this.sent = '';
        if (connection === 'live') this.hooks.onLive();
      },
      onEvents: this.onEvents,
      onProblem: (text) => {
        notice(text, 'error');
      },
      onTick: this.onTick,
      onRestored: () => {
        this.sent = '';
      },
    });
  }

  /** The chosen character. */
  get own(): Character | undefined {
    return this.crowd.all.get(useScenes.getState().actor ?? '');
  }

  /** Puts a character into a scene. Once it is on the stage it does `first`. */
  async put(
    scene: string,
    pack: string,
    at: { x: number; z: number; heading?: number },
    first?: Intent,
  ): Promise<Character | undefined> {
    const kind = await this.bodies.of(pack, '');
    const role = { pack, body: kind.body, style: kind.defaultStyle, scene };
    const seed = SEED + this.opened;
    const tint = this.opened++;
    const [made] = await this.crowd.open([{ role, heading: 0, ...at, seed, priority: 1, tint }]);
    if (made && first) this.first.set(made.id, first);
    if (made) this.choose(made.id);
    return made;
  }

  choose(id: string | null): void {
    const one = this.crowd.all.get(id ?? '');
    this.stage.select(one ? one.id : null);
    this.sent = '';
    const { style } = one?.role ?? { style: '' };
    useScenes.setState({
      actor: one?.id ?? null,
      actors: this.crowd.all.size,
      styles: one?.kind.styles ?? [],
      style,
      speed: usualSpeed(one, style),
    });
    this.follow(useScenes.getState().follow);
  }

  /** Takes the chosen character out. */
  leave(): void {
    if (this.own) this.close([this.own]);
  }

  leaveAll(): void {
    this.close([...this.crowd.all.values()]);
  }

  /** Takes all out, and waits until the server has closed their sessions. */
  async leaveNow(): Promise<void> {
    const sessions = [...this.crowd.all.values()].map(({ session }) => session);
    await Promise.all(sessions.map((session) => this.api.closeSession(session)));
    this.leaveAll();
  }

  setStyle(style: string): void {
    const { own } = this;
    if (!own) return;
    own.role.style = style;
    useScenes.setState({ style, speed: usualSpeed(own, style) });
  }

  follow(on: boolean): void {
    useScenes.setState({ follow: on });
    this.stage.follow(on ? (this.own?.id ?? null) : null);
  }

  tell(intent: Intent): void {
    const { own } = this;
    if (!own) {
      notice('Add a character to the scene first.');
      return;
    }
    this.sent = '';
    this.crowd.command([own.command(intent)]);
  }

  /** One frame of the screen. `dt` in seconds. */
  frame(now_ms: number, dt: number): void {
    this.crowd.clock.advance(dt);
    this.steer(now_ms);
    for (const one of this.crowd.all.values()) {
      if (!one.sample(this.crowd.clock.now)) continue;
      if (!one.isShown) {
        this.stage.add(one.id, one.kind.skeleton, { tint: one.tint });
        one.isShown = true;
        if (one === this.own) this.choose(one.id);
        const first = this.first.get(one.id);
        this.first.delete(one.id);
        if (first) this.crowd.command([one.command(first)]);
      }
      this.stage.pose(one.id, one);
    }
  }

  dispose(): void {
    this.leaveAll();
    this.controls.dispose();
    this.crowd.dispose();
  }

  private close(characters: readonly Character[]): void {
    for (const one of characters) if (one.isShown) this.stage.remove(one.id);
    this.crowd.close(characters);
    this.choose([...this.crowd.all.keys()].at(-1) ?? null);
  }

  private steer(now_ms: number): void {
    const { own } = this;
    if (!own) return;
    const wish = this.controls.wish();
    const wants = wish.right !== 0 || wish.ahead !== 0;
    // An interaction goes on until a key asks for something else.
    if (!wants && !this.hadWish) return;
    if (wants && now_ms - this.sentAt_ms < COMMAND_MS) return;
    this.sentAt_ms = now_ms;
    this.hadWish = wants;
    const { style, speed } = useScenes.getState();
    const running = runningSpeed(own.kind.styles.find((one) => one.name === style));
    const velocity = velocityOf(wish, this.stage.cameraYaw(), speed, running);
    const locomote: Locomote = { style, ...(velocity ? { velocity } : {}) };
    const json = JSON.stringify(locomote);
    if (json === this.sent) return;
    this.sent = json;
    this.crowd.command([own.command({ locomote })]);
  }

  private readonly onTick = ({ held }: TickMessage): void => {
    for (const { instance, position, rotation } of held) {
      const track = this.held.get(instance) ?? new HeldTrack();
      this.held.set(instance, track);
      track.push(this.crowd.clock.newest, position, rotation);
    }
  };

  private readonly onEvents = (sessions: SessionEvents[]): void => {
    for (const { session_id, events } of sessions) {
      const who = this.crowd.characterOf(session_id)?.id;
      if (who === undefined) continue;
      for (const event of events) {
        const [frame, says] = [Number(event.frame), describe(event)];
        if (says) log({ frame, seconds: frame / RATE_HZ, who, ...says });
      }
    }
    this.hooks.onChange();
  };
}

function usualSpeed(one: Character | undefined, style: string): number {
  const speed = one?.kind.styles.find((of) => of.name === style)?.default_speed ?? 1.3;
  return Math.round(Math.max(0.3, speed) * 10) / 10;
}
