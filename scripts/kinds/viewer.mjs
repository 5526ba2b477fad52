// Reads files as web/src/editor/reading.ts does: jobs as JSON on standard input, answers on standard
// output. Each is read onto a rig, at the rig's rate.
import { readFileSync } from 'node:fs';
import * as reader from '../../web/src/reader/troupe_reader_web.js';

const wasm = new URL('../../web/src/reader/troupe_reader_web_bg.wasm', import.meta.url);
await reader.default({ module_or_path: readFileSync(wasm) });

// A person gives options by their controls, which the page has for these.
const controls = JSON.parse(reader.options());

function valuesOf(given, isRobot) {
  const shown = controls.filter((option) => !option.is_of_robots || isRobot).map(({ name }) => name);
  return Object.fromEntries(Object.entries(given).filter(([name]) => shown.includes(name)));
}

function understand({ path, tables, fps, given }) {
  const [name, bytes] = [path.split('/').pop(), readFileSync(path)];
  const names = /\.gl(b|tf)$/i.test(name) ? reader.animations(bytes) : [];
  const robot = tables.robot ? { robot: { name: tables.robot.name, hinges: tables.robot.hinges, mimics: tables.robot.mimics ?? [] } } : {};
  const options = { skeleton: tables.skeleton, ...robot, resample_fps: fps, ...valuesOf(given, 'robot' in robot) };
  if (names.length > 1) options.animation = names[0];
  const read = reader.read(name, bytes, JSON.stringify(options));
  const turns = [];
  const { rotations, roots, offsets } = read;
  for (let at = 0; at < rotations.length; at += 4) {
    const [x, y, z, w] = rotations.subarray(at, at + 4);
    turns.push([w, x, y, z]);
  }
  const triples = (of) => Array.from({ length: of.length / 3 }, (_, n) => Array.from(of.subarray(3 * n, 3 * n + 3)));
  const joints = read.names.length;
  const frames = Array.from({ length: read.frames }, (_, n) => turns.slice(n * joints, (n + 1) * joints));
  return {
    fps: read.fps,
    names: read.names,
    parents: Array.from(read.parents),
    offsets: triples(offsets),
    roots: triples(roots),
    turns: frames,
    notes: JSON.parse(read.table).map((row) => row.join(': ')),
  };
}

const jobs = JSON.parse(readFileSync(0, 'utf8'));
const answers = jobs.map((job) => {
  try {
    return understand(job);
  } catch (error) {
    return { error: error.message, asks: JSON.parse(error.options ?? '[]').map(({ option }) => option) };
  }
});
process.stdout.write(JSON.stringify(answers));
