// The scenes mode at work: the scene that is shown, its objects, and the characters in it.
import type { Stage } from '../stage/types';
import type { Api } from '../wire/api';
import { ApiError } from '../wire/api';
import { Bodies } from '../live/bodies';
import { Finder, panelsWidth } from '../live/finder';
import type { Link } from '../live/hash';
import { Meter } from '../live/meter';
import { notice, report } from '../live/store';
import { Actors } from './actors';
import { SceneCalls } from './calls';
import type { TextDocument } from './document';
import { readDocument } from './document';
import { SceneDrawing } from './drawing';
import { firstSightOf } from './first-sight';
import { Handle } from './handle';
import { clearScenes, freeId, useScenes } from './store';
import type { SceneTool } from './store';
import type { Drawn, Placement, Scene } from './types';
import { upright } from './types';

/** State of the camera for a scene without a seat. */
const CAMERA = [0, 0.6, 0.5, Math.PI - 0.55, 1.05, 14];
/** Time between looks at the scene: others change it too, ms. */
const LOOK_MS = 1000;
/** An object that was let go stays in the hand until a look that began this much later, ms. */
const LET_GO_MS = 150;

export class Scenes {
  readonly calls: SceneCalls;
  readonly bodies: Bodies;
  readonly actors: Actors;
  readonly drawing: SceneDrawing;
  readonly frame_ms = new Meter();
  frames = 0;
  private readonly handle: Handle;
  private readonly finder: Finder;
  private readonly drawn = new Map<string, Drawn>();
  /** Revisions of the definitions that are drawn. */
  private readonly revisions = new Map<string, string>();
  private revision = '';
  /** State of the camera when the scene was opened. */
  private home: number[] = CAMERA;
  /** Whether the link that was opened says where the camera is. */
  private hasOwnView = false;
  /** When the look began whose answer is shown, ms. */
  private lookedAt = 0;
  private looking: Promise<void> | undefined;
  private timer: ReturnType<typeof setInterval> | undefined;
  private disposed = false;

  constructor(
    readonly stage: Stage,
    api: Api,
  ) {
    clearScenes();
    stage.setCamera(CAMERA);
    this.calls = new SceneCalls(api);
    this.bodies = new Bodies(api);
    this.drawing = new SceneDrawing(stage);
    this.finder = new Finder(stage, panelsWidth);
    this.handle = new Handle(
      stage,
      () => undefined,
      () => {
        this.endDrag();
      },
    );
    this.actors = new Actors(stage, api, this.bodies, {
      onLive: () => {
        this.revision = '';
        this.look();
      },
      onChange: this.look,
    });
  }

  /** Reads what there is, and opens the scene that the link names, or the first. */
  async start(link: Link): Promise<void> {
    await this.bodies.load();
    useScenes.setState({ packs: this.bodies.packs, follow: link.follow ?? false, isLeftEmpty: link.n === 0 });
    this.hasOwnView = link.cam !== undefined;
    await this.actors.crowd.connect();
    await this.refresh();
    const { scenes } = useScenes.getState();
    if (link.scene && !scenes.some(({ name }) => name === link.scene)) {
      notice(`The server has no scene named ${link.scene}.`, 'error');
    }
    const first = scenes.find(({ name }) => name === link.scene) ?? scenes[0];
    if (first) await this.open(first.name);
    if (link.sel) this.choose(link.sel);
    this.timer = setInterval(() => {
      if (!document.hidden) this.look();
    }, LOOK_MS);
  }

  /** Reads the lists of scenes and definitions. */
  async refresh(): Promise<void> {
    const [scenes, definitions] = await Promise.all([this.calls.scenes(), this.calls.definitions()]);
    useScenes.setState(({ placing }) => ({
      isRead: true,
      scenes,
      definitions,
      placing: definitions.some(({ name }) => name === placing) ? placing : (definitions[0]?.name ?? null),
    }));
    const stale = definitions.filter(({ name, revision }) => this.revisions.get(name) !== revision);
    await Promise.all(
      stale.map(async ({ name, revision }) => {
        this.drawn.set(name, await this.calls.drawn(name));
        this.revisions.set(name, revision);
      }),
    );
    this.drawObjects();
  }

  /** Shows a scene. Characters stay in the scene that they were put into, so they leave. */
  async open(name: string): Promise<void> {
    const isNew = useScenes.getState().scene !== name;
    if (isNew) {
      this.actors.leaveAll();
      this.actors.held.clear();
      this.drawing.clear();
      this.choose(null);
      useScenes.setState({ log: [] });
    }
    this.revision = '';
    this.show(await this.calls.scene(name), performance.now());
    if (isNew) await this.showFirstSight().catch(report);
  }

  /** Puts a character in that sits down, so that a scene is not empty at first sight. */
  private async showFirstSight(): Promise<void> {
    const { scene, objects, definitions, isLeftEmpty } = useScenes.getState();
    const sight = firstSightOf(objects, this.drawn, definitions);
    this.home = sight?.camera ?? CAMERA;
    if (!this.hasOwnView) this.stage.setCamera(this.home);
    this.hasOwnView = false;
    if (scene === null || !sight || isLeftEmpty || this.disposed || !this.bodies.pack(sight.pack)) return;
    const { seat, isFree, pack, start, heading } = sight;
    await this.actors.put(scene, pack, { ...start, heading }, isFree ? { interact: { instance: seat } } : undefined);
    if (isFree) notice(`Your character sits down on ${seat}. W A S D takes over, X makes it rise.`);
    else notice(`Another character has ${seat}. Yours stands before it and walks with W A S D.`);
  }

  async makeScene(name: string): Promise<void> {
    if (useScenes.getState().scenes.some((scene) => scene.name === name)) {
      throw new Error(`name: a scene named ${name} exists already`);
    }
    await this.calls.putEmptyScene(name);
    await this.refresh();
    await this.open(name);
  }

  async deleteScene(): Promise<void> {
    const { scene } = useScenes.getState();
    if (scene === null) return;
    await this.actors.leaveNow();
    await this.calls.deleteScene(scene);
    this.forget();
    await this.refresh();
    const [first] = useScenes.getState().scenes;
    if (first) await this.open(first.name);
  }

  /** Uploads files: definitions first, because scenes need them. */
  async upload(files: readonly { name: string; text: string }[]): Promise<void> {
    const documents = files.map(({ name, text }) => readDocument(name, text));
    documents.sort((a, b) => Number(a.kind === 'scene') - Number(b.kind === 'scene'));
    for (const document of documents) await this.calls.put(document);
    await this.refresh();
    this.revision = '';
    const scene = documents.findLast(({ kind }) => kind === 'scene');
    if (scene) await this.open(scene.name);
    else this.look();
    notice(`${documents.map(saysOf).join(', ')}.`);
    const object = documents.findLast(({ kind }) => kind === 'object');
    if (object && !scene) useScenes.setState({ placing: object.name });
  }

  choose(id: string | null): void {
    const found = useScenes.getState().objects.some((object) => object.id === id) ? id : null;
    useScenes.setState({ object: found });
    this.drawing.choose(found, this.drawn);
    this.showHandle();
  }

  chooseNext(step: 1 | -1): void {
    const { objects, object } = useScenes.getState();
    const at = objects.findIndex(({ id }) => id === object);
    const next = at < 0 && step < 0 ? objects.length - 1 : (at + step + objects.length) % objects.length;
    this.choose(objects[next]?.id ?? null);
  }

  setTool(tool: SceneTool): void {
    useScenes.setState({ tool });
    this.showHandle();
    this.stage.three.canvas.classList.toggle('draws', tool === 'place');
  }

  /** What a click on the stage does: puts an object down, or chooses what is there. */
  click(x: number, y: number): void {
    const { tool, ground } = useScenes.getState();
    if (tool === 'place') {
      const at = this.drawing.surface(x, y, ground);
      if (at) void this.add({ position: at, rotation: upright(0) }).catch(report);
      return;
    }
    if (this.handle.isUnderPointer) return;
    const { character, object } = this.stage.pick(x, y);
    if (character) this.actors.choose(character);
    else this.choose(object ?? null);
  }

  /** Puts an object of the chosen definition down. Without a place: where the camera looks. */
  async add(at?: Placement): Promise<void> {
    const { scene, placing, objects } = useScenes.getState();
    if (scene === null || placing === null) return;
    const id = freeId(placing, objects);
    await this.calls.add(scene, id, placing, at ?? this.middle());
    await this.looked();
    this.choose(id);
    this.setTool('move');
  }

  /** Moves the chosen object. Where the server refuses, it goes back. */
  async move(to: Placement): Promise<void> {
    const { scene, object } = useScenes.getState();
    if (scene === null || object === null) return;
    try {
      await this.calls.move(scene, object, rounded(to));
    } finally {
      await this.looked();
      const now = useScenes.getState().objects.find(({ id }) => id === object);
      if (now) this.drawing.settle(now);
    }
  }

  async remove(): Promise<void> {
    const { scene, object } = useScenes.getState();
    if (scene === null || object === null) return;
    await this.calls.remove(scene, object);
    this.choose(null);
    await this.looked();
  }

  /** Puts a character into the scene, where the camera looks. */
  async putActor(pack: string): Promise<void> {
    const { scene } = useScenes.getState();
    if (scene === null) return;
    const { x, z } = this.middle().position;
    useScenes.setState({ isLeftEmpty: false });
    await this.actors.put(scene, pack, { x, z });
  }

  /** Takes the chosen character out. */
  takeActorOut(): void {
    this.actors.leave();
    useScenes.setState(({ actors }) => ({ isLeftEmpty: actors === 0 }));
  }

  /** Turns the camera to the chosen character; without one, to where it looked at the start. */
  findActor(): void {
    const { own } = this.actors;
    if (!own) {
      this.resetView();
      return;
    }
    this.actors.follow(false);
    this.finder.find(own.id);
  }

  /** The camera as when the scene was opened. */
  resetView(): void {
    this.actors.follow(false);
    this.finder.rest();
    this.stage.setCamera(this.home);
  }

  /** Has the chosen character use the chosen object. Empty names leave the choice to the server. */
  use(variant = '', approach = ''): void {
    const { object } = useScenes.getState();
    if (object === null) {
      notice('Choose an object first.');
      return;
    }
    this.actors.tell({
      interact: { instance: object, ...(variant ? { variant } : {}), ...(approach ? { approach } : {}) },
    });
  }

  /** One frame of the screen. `dt` in seconds. */
  frame(now_ms: number, dt: number): void {
    this.frames += 1;
    this.actors.frame(now_ms, dt);
    this.finder.frame(this.actors.own?.id, useScenes.getState().follow);
    const { now } = this.actors.crowd.clock;
    for (const [id, track] of this.actors.held) {
      if (track.newest > now || !this.wasLetGo(id, track.newest, now)) this.drawing.showHeld(id, track, now);
      else this.letGo(id);
    }
  }

  /** Reads the scene again, unless a look is under way. */
  readonly look = (): void => {
    this.looked().catch((error: unknown) => {
      if (error instanceof ApiError && error.status === 404) this.vanish();
      else if (!(error instanceof ApiError && error.mayPass)) report(error);
    });
  };

  dispose(): void {
    this.disposed = true;
    clearInterval(this.timer);
    this.handle.dispose();
    this.finder.dispose();
    this.actors.dispose();
    this.drawing.dispose();
    this.stage.setGround(0);
    this.stage.three.canvas.classList.remove('draws');
  }

  private async looked(): Promise<void> {
    // A look that is under way may have begun before what the caller did.
    if (this.looking) await this.looking.catch(() => undefined);
    this.looking = this.lookNow().finally(() => {
      this.looking = undefined;
    });
    await this.looking;
  }

  private async lookNow(): Promise<void> {
    const { scene: name } = useScenes.getState();
    if (name === null) return;
    const began = performance.now();
    // The holder of an object may change without a new revision; colliders may not.
    const small = await this.calls.scene(name, true);
    const whole = small.revision === this.revision ? small : await this.calls.scene(name);
    if (this.isDisposed() || useScenes.getState().scene !== name) return;
    if (whole.objects.some(({ definition }) => !this.drawn.has(definition))) await this.refresh();
    this.show(whole, began);
  }

  private isDisposed(): boolean {
    return this.disposed;
  }

  private show(scene: Scene, began: number): void {
    const { name, ground, objects, revision } = scene;
    this.lookedAt = began;
    if (revision !== this.revision) {
      this.revision = revision;
      this.drawing.setColliders(scene.colliders);
      this.stage.setGround(ground);
      useScenes.setState({ colliders: scene.colliders.length });
    }
    useScenes.setState({ scene: name, ground, objects });
    this.drawObjects();
    if (!objects.some(({ id }) => id === useScenes.getState().object)) this.choose(null);
  }

  private drawObjects(): void {
    const { objects, object } = useScenes.getState();
    this.drawing.setObjects(objects, this.drawn, this.handle.isDragged ? object : null);
    this.showHandle();
  }

  private forget(): void {
    this.drawing.clear();
    this.stage.setGround(0);
    this.revision = '';
    useScenes.setState({ scene: null, objects: [], colliders: 0, ground: 0 });
    this.choose(null);
  }

  private vanish(): void {
    notice(`The scene ${useScenes.getState().scene ?? ''} is gone.`, 'error');
    this.actors.leaveAll();
    this.forget();
    void this.refresh().catch(report);
  }

  private showHandle(): void {
    const { object, tool, objects } = useScenes.getState();
    const isHeld = objects.some(({ id, state }) => id === object && state === 'OBJECT_STATE_HELD');
    const shown =
      object === null || isHeld || (tool !== 'move' && tool !== 'turn') ? undefined : this.drawing.object(object);
    this.handle.show(shown, tool === 'turn' ? 'turn' : 'move');
  }

  private endDrag(): void {
    const { object } = useScenes.getState();
    const to = object === null ? undefined : this.drawing.placement(object);
    if (to) this.move(to).catch(report);
  }

  /** Whether the scene as it is shown is from after an object left the hand. */
  private wasLetGo(id: string, newest: number, now: number): boolean {
    const object = useScenes.getState().objects.find((one) => one.id === id);
    if (object?.state === 'OBJECT_STATE_HELD') return false;
    const endedAt = performance.now() - (now - newest) * 1000;
    return this.lookedAt > endedAt + LET_GO_MS;
  }

  private letGo(id: string): void {
    this.actors.held.delete(id);
    const object = useScenes.getState().objects.find((one) => one.id === id);
    if (object) this.drawing.settle(object);
  }

  /** The place on the ground that the camera looks at. */
  private middle(): Placement {
    const [x = 0, , z = 0] = this.stage.cameraState();
    return rounded({ position: { x, y: useScenes.getState().ground, z }, rotation: upright(0) });
  }
}

/** To millimetres: what people read and write. */
function rounded({ position, rotation }: Placement): Placement {
  const round = (value: number) => Math.round(value * 1000) / 1000;
  return { position: { x: round(position.x), y: round(position.y), z: round(position.z) }, rotation };
}

function saysOf({ kind, name }: TextDocument): string {
  return kind === 'scene' ? `The scene ${name} is uploaded` : `Objects of ${name} can be placed`;
}
