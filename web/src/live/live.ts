// The live mode at work: the crowd, the own character, tools, and a frame of the screen.
import type { Stage } from '../stage/types';
import type { Api } from '../wire/api';
import type { TickMessage } from '../wire/messages';
import type { Command, Intent, Locomote, SessionEvents, Skill } from '../wire/types';
import type { BodyKind } from './bodies';
import { Bodies, runningSpeed } from './bodies';
import type { CrowdChoice, Role } from './cast';
import { castOf, MOST_CHARACTERS } from './cast';
import type { Character } from './character';
import { Controls, velocityOf } from './control';
import { Crowd } from './crowd';
import { Finder, panelsWidth } from './finder';
import type { Link } from './hash';
import { Meter, Rate } from './meter';
import type { Place } from './path';
import { pathFrom, ribbon } from './path';
import { RATE_HZ } from './playback';
import { clearLive, notice, report, useLive } from './store';
import { SkillControl } from './skill-control';
import { places, radiusFor, Wanderer } from './steering';
import { after, SILENT, whyMute } from './words';

/** Sessions that one call opens. */
const CHUNK = 64;
/** Least time between commands of the own character, ms. */
const COMMAND_MS = 80;
/** How fast Q and E turn the face, rad/s. */
const TURN = 2.4;
/** Colour of the own character, and of its paths. */
const OWN_TINT = 0;
const SEED = 20;

export class Live {
  readonly bodies: Bodies;
  readonly crowd: Crowd;
  readonly meters = {
    frame_ms: new Meter(),
    decode_ms: new Meter(),
    bytes: new Rate(),
    frames: 0,
    underruns: 0,
    dropped: 0,
  };
  /** The own character. */
  own: Character | undefined;
  /** State of the camera at the start. */
  private home: number[] = [];
  private readonly controls = new Controls();
  private facing: number | undefined;
  /** The last command of the keys, as JSON; empty when the next one must be sent in any case. */
  private sent = '';
  private sentAt_ms = 0;
  private hadWish = false;
  private stepDebt = 0;
  private aliveAt = 0;
  private stopDrawing: (() => void) | undefined;
  /** Number of the command that said a sentence last. */
  private said = 0;
  private readonly skills: SkillControl;
  private readonly finder: Finder;
  private readonly radius = { m: radiusFor(24) };
  /** Crowds are changed one after the other. */
  private changes: Promise<void> = Promise.resolve();

  constructor(
    readonly stage: Stage,
    readonly api: Api,
  ) {
    clearLive();
    this.bodies = new Bodies(api);
    this.skills = new SkillControl(this);
    this.finder = new Finder(stage, panelsWidth);
    this.crowd = new Crowd(api, this.bodies, {
      onConnection: (state, why) => {
        useLive.setState({ connection: state, trouble: why });
        if (state !== 'live') return;
        this.sent = '';
        this.skills.onConnected();
      },
      onEvents: this.onEvents,
      onProblem: (text, session, sequence) => {
        notice(text, 'error');
        if (this.crowd.characterOf(session ?? '') !== this.own) return;
        if (sequence === this.said) useLive.setState({ saying: SILENT });
        this.skills.onRefused(sequence);
      },
      onTick: this.onTick,
      onRestored: (characters) => {
        for (const one of characters) one.rest = 0;
        if (!this.own || !characters.includes(this.own)) return;
        this.sent = '';
        this.skills.reset();
      },
    });
  }

  /** Loads the packs, opens the stream and a crowd. */
  async start(link: Link): Promise<void> {
    this.home = [0, 0.7, 0, Math.PI - 0.5, 1.16, 6 + radiusFor(link.n ?? useLive.getState().crowd.count) * 1.15];
    this.stage.setCamera(link.cam ?? this.home);
    await this.bodies.load();
    const main = this.bodies.pack(link.pack ?? '') ?? this.bodies.defaultPack;
    if (!main) throw new Error('the server has no pack that drives live characters');
    useLive.setState(({ crowd, player }) => ({
      packs: this.bodies.packs,
      player: { ...player, pack: main.name, body: link.body ?? '', style: link.style ?? '' },
      crowd: {
        ...crowd,
        count: Math.min(MOST_CHARACTERS, Math.max(1, link.n ?? crowd.count)),
        who: link.who || crowd.who,
      },
    }));
    await this.crowd.connect();
    if (!this.own) await this.changeOwn(main.name, link.body ?? '', link.style ?? '');
    await this.changeCrowd(useLive.getState().crowd);
  }

  /** Brings the crowd to what was chosen. The own character stays. */
  changeCrowd(choice: CrowdChoice): Promise<void> {
    useLive.setState({ crowd: choice });
    this.changes = this.changes.then(() => this.bringCrowd(choice)).catch(report);
    return this.changes;
  }

  private async bringCrowd(choice: CrowdChoice): Promise<void> {
    useLive.setState({ busy: true });
    try {
      const count = choice.count - 1;
      this.radius.m = radiusFor(choice.count);
      const roles = await castOf(this.bodies, choice, count);
      const wanted = new Map<string, number>();
      roles.forEach((role) => wanted.set(keyOf(role), (wanted.get(keyOf(role)) ?? 0) + 1));
      const rest: Character[] = [];
      for (const one of this.crowd.all.values()) {
        if (one === this.own) continue;
        const left = wanted.get(keyOf(one.role)) ?? 0;
        if (left > 0) wanted.set(keyOf(one.role), left - 1);
        else rest.push(one);
      }
      this.remove(rest);
      const at = places(choice.count, SEED);
      const missing = roles.flatMap((role, i) => {
        const left = wanted.get(keyOf(role)) ?? 0;
        if (left === 0) return [];
        wanted.set(keyOf(role), left - 1);
        const { x, z, heading } = at[i + 1]!;
        return { role, x, z, heading, seed: i + 1, priority: 0.5, tint: i + 1 };
      });
      for (let i = 0; i < missing.length; i += CHUNK) {
        const opened = await this.crowd.open(missing.slice(i, i + CHUNK));
        opened.forEach((one, j) => {
          const opening = missing[i + j]!;
          one.wanderer = new Wanderer(SEED + opening.seed, opening.heading);
          one.rest = 0.4 + (j % 16) * 0.1;
        });
        useLive.setState({ characters: this.crowd.all.size });
      }
    } finally {
      useLive.setState({ busy: false, characters: this.crowd.all.size });
    }
  }

  /** Makes the own character another body, where it stands. */
  async changeOwn(pack: string, body: string, style: string): Promise<void> {
    const kind = await this.bodies.of(pack, body);
    const wanted = kind.styles.find((one) => one.name === style) ? style : kind.defaultStyle;
    const old = this.own;
    const [x, z] = old ? [old.root[0]!, old.root[2]!] : [0, 0];
    const role = { pack, body: kind.body, style: wanted };
    const [made] = await this.crowd.open([{ role, x, z, heading: 0, seed: SEED, priority: 1, tint: OWN_TINT }]);
    if (!made) return;
    const { selected, follow } = useLive.getState();
    if (old) this.remove([old]);
    this.own = made;
    this.sent = '';
    this.facing = undefined;
    this.forgetPath();
    this.skills.reset();
    const speed = kind.styles.find((one) => one.name === wanted)?.default_speed ?? 1.3;
    useLive.setState({
      styles: kind.styles,
      words: kind.words,
      skills: kind.skills,
      characters: this.crowd.all.size,
      player: {
        pack,
        body: kind.body,
        style: wanted,
        speed: Math.round(Math.max(0.3, speed) * 10) / 10,
        gait: '',
        height: undefined,
        facesAway: false,
      },
    });
    this.listenTo(kind).catch(report);
    if (!old || selected === old.id) this.select(made.id);
    if (follow) this.follow(true);
  }

  /** Changes how the own character moves, from its next command on. */
  setPlayer(change: Partial<ReturnType<typeof useLive.getState>['player']>): void {
    useLive.setState(({ player, styles }) => {
      const next = { ...player, ...change };
      if (change.style && change.style !== player.style) {
        const speed = styles.find((one) => one.name === change.style)?.default_speed ?? next.speed;
        next.speed = Math.round(Math.max(0.3, speed) * 10) / 10;
        next.gait = '';
        next.height = undefined;
      }
      return { player: next };
    });
    if (useLive.getState().path.state !== 'walking') this.steerNow(true);
  }

  /** Sends the own character's movement again, even if it has not changed. */
  repeat(): void {
    this.sent = '';
    this.steerNow(true);
  }

  faceFreely(): void {
    this.facing = undefined;
    this.setPlayer({ facesAway: false });
  }

  select(id: string | null): void {
    useLive.setState({ selected: id });
    this.stage.select(id);
    if (useLive.getState().follow) this.follow(true);
  }

  /** Selects the next character, or the one before. */
  selectNext(step: 1 | -1): void {
    const ids = [...this.crowd.all.keys()];
    const at = ids.indexOf(useLive.getState().selected ?? '');
    this.select(ids[(at + step + ids.length) % ids.length] ?? null);
  }

  /** The camera as at the start. */
  resetView(): void {
    this.follow(false);
    this.finder.rest();
    this.stage.setCamera(this.home);
  }

  /** Turns the camera to the own character. */
  findOwn(): void {
    this.follow(false);
    if (this.own) this.finder.find(this.own.id);
  }

  follow(on: boolean): void {
    useLive.setState({ follow: on });
    this.stage.follow(on ? (useLive.getState().selected ?? this.own?.id ?? null) : null);
  }

  setTool(tool: 'point' | 'draw'): void {
    this.stopDrawing?.();
    this.stopDrawing = undefined;
    useLive.setState({ tool });
    if (tool !== 'draw') return;
    this.stopDrawing = this.stage.drawOnGround({
      onDraw: (points) => {
        this.stage.line('path', raised(points), { tint: OWN_TINT, width_m: 0.07, dashed: true });
      },
      onEnd: (points) => {
        this.walkAlong(toPlaces(points));
      },
    });
  }

  /** What a click on the stage does: selects a character, or sends the own one to a place. */
  click(x: number, y: number): void {
    if (useLive.getState().tool === 'draw') return;
    const { character, ground } = this.stage.pick(x, y);
    if (character) this.select(character);
    else if (ground && this.own)
      this.walkAlong([
        [this.own.root[0]!, this.own.root[2]!],
        [ground[0], ground[2]],
      ]);
  }

  /** Sends the own character along a line over the ground. */
  walkAlong(drawn: readonly Place[]): void {
    const { own } = this;
    if (!own) return;
    const points = pathFrom(drawn, [own.root[0]!, own.root[2]!]);
    if (!points) {
      this.forgetPath();
      return;
    }
    const { style, speed } = useLive.getState().player;
    const line = points.map(({ position }): Place => [position.x, position.z]);
    this.stage.line('path', ribbon(line), { tint: OWN_TINT, width_m: 0.07 });
    this.tell({ follow_path: { points, style, speed } });
    this.skills.forgetAsked();
    this.sent = '';
    useLive.setState({ path: { state: 'walking', text: `follows a path of ${length(line).toFixed(1)} m` } });
  }

  /** Has the own character act out words. What becomes of it comes with its events. */
  say(text: string): void {
    const { own } = this;
    if (!own) return;
    this.forgetPath();
    this.skills.forgetAsked();
    this.said = this.tell({ perform: { text } });
    useLive.setState({ saying: { ...SILENT, state: 'waiting', text } });
  }

  /** Starts a skill of the own character, or ends it if it is held now. */
  doSkill(skill: Skill): void {
    this.forgetPath();
    this.skills.ask(skill);
  }

  /** Finds out whether the own character takes words. */
  private async listenTo(kind: BodyKind): Promise<void> {
    useLive.setState({ mute: '', saying: SILENT });
    const mute = whyMute(await this.bodies.speakers(), kind.skeleton);
    if (this.own?.kind === kind) useLive.setState({ mute });
  }

  /** Sends the own character a command. Returns its number, or 0 without an own character. */
  tell(intent: Intent): number {
    const command = this.own?.command(intent);
    if (command) this.crowd.command([command]);
    return command?.sequence ?? 0;
  }

  /** After a skill the character stands: a key that is still down counts again. */
  onSkillOver(): void {
    this.sent = '';
  }

  setTime(paused: boolean, speed: number): void {
    useLive.setState({ time: { paused, speed } });
    this.crowd.setOwnClock(paused || speed !== 1);
    this.crowd.clock.speed = paused ? 0 : speed;
    this.stepDebt = 0;
  }

  /** Goes on by one frame while time stands. */
  step(): void {
    if (!useLive.getState().time.paused) this.setTime(true, useLive.getState().time.speed);
    void this.crowd.step();
  }

  /** One frame of the screen. `dt` in seconds. */
  frame(now_ms: number, dt: number): void {
    this.runOwnClock(now_ms, dt);
    this.crowd.clock.advance(dt);
    this.steerOwn(now_ms, dt);
    this.steerCrowd(dt);
    for (const one of this.crowd.all.values()) {
      if (!one.sample(this.crowd.clock.now)) continue;
      if (!one.isShown) {
        this.stage.add(one.id, one.kind.skeleton, { tint: one.tint });
        one.isShown = true;
        if (useLive.getState().selected === one.id) this.select(one.id);
      }
      this.stage.pose(one.id, one);
    }
    this.finder.frame(this.own?.id, useLive.getState().follow);
    this.meters.frames += 1;
  }

  dispose(): void {
    this.finder.dispose();
    this.stopDrawing?.();
    this.controls.dispose();
    this.stage.follow(null);
    this.forgetPath();
    this.remove([...this.crowd.all.values()]);
    this.crowd.dispose();
  }

  private remove(characters: readonly Character[]): void {
    for (const one of characters) if (one.isShown) this.stage.remove(one.id);
    this.crowd.close(characters);
    const { selected } = useLive.getState();
    if (characters.some((one) => one.id === selected)) {
      this.select(this.own && this.crowd.all.has(this.own.id) ? this.own.id : null);
    }
  }

  private runOwnClock(now_ms: number, dt: number): void {
    const { paused, speed } = useLive.getState().time;
    if (!this.crowd.isOwnClock) return;
    if (now_ms - this.aliveAt > 20_000) {
      this.aliveAt = now_ms;
      this.crowd.keepAlive();
    }
    if (paused) return;
    this.stepDebt = Math.min(2, this.stepDebt + dt * RATE_HZ * speed);
    if (this.stepDebt < 1) return;
    this.stepDebt -= 1;
    void this.crowd.step();
  }

  private steerOwn(now_ms: number, dt: number): void {
    const wish = this.controls.wish();
    if (wish.turn !== 0 && this.own) {
      this.facing = (this.facing ?? this.own.moving ?? 0) + wish.turn * TURN * dt;
      if (!useLive.getState().player.facesAway) this.setPlayer({ facesAway: true });
    }
    const wants = wish.right !== 0 || wish.ahead !== 0 || wish.turn !== 0;
    // A path goes on until a key asks for something else.
    if (!wants && !this.hadWish) return;
    if (now_ms - this.sentAt_ms < COMMAND_MS && wants) return;
    this.sentAt_ms = now_ms;
    this.hadWish = wants;
    if (wants) this.forgetPath();
    this.steerNow(false);
  }

  private steerNow(always: boolean): void {
    const { own } = this;
    if (!own) return;
    const { player, styles } = useLive.getState();
    const style = styles.find((one) => one.name === player.style);
    const velocity = velocityOf(this.controls.wish(), this.stage.cameraYaw(), player.speed, runningSpeed(style));
    const locomote: Locomote = { style: player.style };
    if (velocity) locomote.velocity = velocity;
    if (this.facing !== undefined) locomote.facing = Math.round(this.facing * 100) / 100;
    if (player.gait) locomote.gait = player.gait;
    if (player.height !== undefined) locomote.height = player.height;
    const json = JSON.stringify(locomote);
    if (json === this.sent && !always) return;
    this.sent = json;
    this.skills.forgetAsked();
    this.tell({ locomote });
  }

  private steerCrowd(dt: number): void {
    if (useLive.getState().time.paused || useLive.getState().connection !== 'live') return;
    const commands: Command[] = [];
    for (const one of this.crowd.all.values()) {
      if (!one.wanderer || !one.isShown) continue;
      one.rest -= dt * useLive.getState().time.speed;
      if (one.rest > 0) continue;
      one.rest = one.wanderer.pause();
      commands.push(one.command(this.wandering(one, one.wanderer)));
    }
    this.crowd.command(commands);
  }

  private wandering(one: Character, wanderer: Wanderer): Intent {
    const style = one.kind.styles.find((of) => of.name === one.role.style);
    const others = [...this.crowd.all.values()]
      .filter((other) => other !== one && other.isShown)
      .map((other) => ({ x: other.root[0]!, z: other.root[2]! }));
    const me = { x: one.root[0]!, z: one.root[2]! };
    const go = wanderer.decide(me, others, this.radius.m, style?.default_speed ?? 1.2);
    return { locomote: go ? { velocity: { x: go.x, y: 0, z: go.z } } : {} };
  }

  private forgetPath(): void {
    this.stage.line('path', null, { tint: OWN_TINT });
    if (useLive.getState().path.state !== 'none') useLive.setState({ path: { state: 'none', text: '' } });
  }

  private readonly onTick = (message: TickMessage): void => {
    this.meters.decode_ms.add(message.decode_ms);
    this.meters.bytes.add(performance.now(), message.bytes);
    this.meters.underruns += message.underruns;
    this.meters.dropped = message.dropped_ticks;
  };

  private readonly onEvents = (sessions: SessionEvents[]): void => {
    for (const of of sessions) {
      if (this.crowd.characterOf(of.session_id) !== this.own) continue;
      for (const kind of of.events) {
        useLive.setState(({ saying }) => ({ saying: after(saying, kind, this.said) }));
        this.skills.onEvent(kind);
        if (!kind.arrived) continue;
        const { late, off } = kind.arrived;
        const text = `arrived ${late.toFixed(1)} s late, ${(off * 100).toFixed(0)} cm from the end`;
        useLive.setState({ path: { state: 'arrived', text } });
        notice(`Your character ${text}.`);
        this.stage.line('path', null, { tint: OWN_TINT });
      }
    }
  };
}

function keyOf({ pack, body, style }: Role): string {
  return `${pack}/${body}/${style}`;
}

function toPlaces(points: Float32Array): Place[] {
  return Array.from({ length: points.length / 3 }, (_, i): Place => [points[i * 3]!, points[i * 3 + 2]!]);
}

function raised(points: Float32Array): Float32Array {
  return ribbon(toPlaces(points));
}

function length(line: readonly Place[]): number {
  return line.slice(1).reduce((sum, place, i) => sum + Math.hypot(place[0] - line[i]![0], place[1] - line[i]![1]), 0);
}
