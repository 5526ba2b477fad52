// The stage alone, for those who work on it: `npm run dev`, then /stage.html. Recordings:
// scripts/stage-clips.sh. ?scene=bodies|crowd|overlays, ?count=200, ?theme=dark, ?skin=1, ?frame=N
// stops time, ?camera=x,y,z,azimuth,polar,distance
import { createStage, type Pose, type Stage } from '../index';
import HUMAN from '../../bodies/human.glb?url';
import { readBvh, type Clip } from './clip';

const FILES = import.meta.glob<string>('./clips/*.bvh', { query: '?url', import: 'default' });
const BODIES = ['human', 'g1', 'horse', 'fox', 'bird', 'spider'];
/** Frames over which times are taken. */
const WINDOW = 120;

interface Played {
  id: string;
  clip: Clip;
  start: number;
  shift: [number, number];
}

interface Demo {
  stage: Stage;
  /** Main-thread times of the last frames, milliseconds: posing, and all of the stage's work. */
  times: { pose: number[]; frame: number[] };
  played: Played[];
  isReady: boolean;
}

declare global {
  interface Window {
    demo?: Demo;
  }
}

const query = new URLSearchParams(location.search);
const scene = query.get('scene') ?? 'bodies';

async function load(name: string): Promise<Clip> {
  const file = FILES[`./clips/${name}.bvh`];
  if (!file) throw new Error(`demo: clips/${name}.bvh is not there; scripts/stage-clips.sh makes it`);
  const answer = await fetch(await file());
  return readBvh(await answer.text());
}

function poseAt({ clip, start, shift }: Played, frame: number, into: Pose): Pose {
  const pose = clip.poses[(Math.floor(frame) + start) % clip.poses.length]!;
  into.root.set(pose.root);
  into.root[0]! += shift[0];
  into.root[2]! += shift[1];
  into.rotations = pose.rotations;
  return into;
}

async function cast(stage: Stage): Promise<Played[]> {
  const played: Played[] = [];
  const add = (clip: Clip, start: number, shift: [number, number]): void => {
    const id = `c${played.length}`;
    stage.add(id, clip.skeleton, { tint: played.length });
    played.push({ id, clip, start, shift });
  };
  const names = query.get('bodies')?.split(',') ?? (scene === 'bodies' ? BODIES : ['human']);
  const clips = await Promise.all(names.map(load));
  if (scene === 'crowd') {
    const count = Number(query.get('count') ?? 200);
    const side = Math.ceil(Math.sqrt(count));
    for (let c = 0; c < count; c++) {
      const place: [number, number] = [((c % side) - side / 2) * 1.6, (Math.floor(c / side) - side / 2) * 1.6];
      add(clips[c % clips.length]!, (c * 37) % 240, place);
    }
    return played;
  }
  clips.forEach((clip, c) => {
    // Standing side by side, whatever way they go.
    const { root } = clip.poses[Number(query.get('frame') ?? 0) % clip.poses.length]!;
    const isFixed = query.has('frame');
    const x = (c - (clips.length - 1) / 2) * 1.7;
    add(clip, 0, isFixed ? [x - root[0]!, -root[2]!] : [x, 0]);
  });
  return played;
}

function overlays(stage: Stage, { clip, shift }: Played): void {
  const path = new Float32Array(clip.poses.flatMap(({ root }) => [root[0]! + shift[0], 0, root[2]! + shift[1]]));
  stage.line('path', path.slice(0, 3 * 120), { tint: 0 });
  stage.line(
    'asked',
    path.slice(3 * 120).map((value, c) => (c % 3 === 0 ? value + 0.1 : value)),
    { tint: 8, dashed: true },
  );
  const moved = (pose: Pose): Pose => ({
    ...pose,
    root: new Float32Array([pose.root[0]! + shift[0], pose.root[1]!, pose.root[2]! + shift[1]]),
  });
  stage.ghosts(
    'plan',
    clip.skeleton,
    [20, 40, 60, 80].map((frame) => moved(clip.poses[frame]!)),
    0.45,
    0,
  );
  stage.discs('contacts', new Float32Array([0, 0, 0, 0.3, 0, 0.2, -0.2, 0, 0.5]), 2);
}

async function start(): Promise<void> {
  const canvas = document.querySelector<HTMLCanvasElement>('#stage');
  const note = document.querySelector<HTMLElement>('#note');
  if (!canvas || !note) throw new Error('demo: the page has no canvas');
  const stage = createStage(canvas, query.get('theme') === 'dark' ? 'dark' : 'light');
  const played = await cast(stage);
  if (query.has('skin')) {
    const glb = await (await fetch(query.get('skin') === '1' ? HUMAN : query.get('skin')!)).arrayBuffer();
    const human = played.find(({ clip }) => clip.skeleton.names.includes('UpperArm_L'));
    if (human) console.log(JSON.stringify(await stage.setSkin(human.clip.skeleton, glb)));
  }
  const demo: Demo = { stage, times: { pose: [], frame: [] }, played, isReady: false };
  window.demo = demo;
  if (query.has('camera')) stage.setCamera(query.get('camera')!.split(',').map(Number));
  if (scene === 'overlays') overlays(stage, played[0]!);
  if (query.has('follow')) stage.follow(played[0]!.id);
  if (scene !== 'crowd') stage.select(played[0]!.id);
  canvas.addEventListener('click', (event) => {
    const picked = stage.pick(event.clientX, event.clientY);
    stage.select(picked.character ?? null);
    note.textContent = JSON.stringify(picked);
  });
  window.addEventListener('resize', () => {
    stage.resize();
  });
  const into: Pose = { root: new Float32Array(3), rotations: new Float32Array(0) };
  const fixed = query.get('frame');
  const begin_ms = performance.now();
  const draw = (): void => {
    const now_ms = performance.now();
    const frame = fixed === null ? ((now_ms - begin_ms) / 1000) * 30 : Number(fixed);
    for (const one of played) stage.pose(one.id, poseAt(one, frame, into));
    const posed_ms = performance.now();
    stage.render();
    demo.times.pose.push(posed_ms - now_ms);
    demo.times.frame.push(performance.now() - now_ms);
    for (const times of [demo.times.pose, demo.times.frame]) if (times.length > WINDOW) times.shift();
    demo.isReady = true;
    requestAnimationFrame(draw);
  };
  draw();
}

void start().catch((error: unknown) => {
  document.querySelector('#note')!.textContent = String(error);
});
