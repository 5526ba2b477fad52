// Reads Prometheus' text format.

export interface Sample {
  name: string;
  labels: Record<string, string>;
  value: number;
}

const LINE = /^([a-zA-Z_:][\w:]*)(?:\{(.*)\})?\s+(\S+)/;
const LABEL = /([a-zA-Z_]\w*)="((?:[^"\\]|\\.)*)"/g;

export function parse(text: string): Sample[] {
  return text.split('\n').flatMap((line) => {
    const found = line.startsWith('#') ? null : LINE.exec(line);
    if (!found) return [];
    const labels: Record<string, string> = {};
    for (const [, name, value] of (found[2] ?? '').matchAll(LABEL)) labels[name!] = value!.replace(/\\(.)/g, '$1');
    return [{ name: found[1]!, labels, value: Number(found[3]) }];
  });
}

/** All samples of one moment, by name. */
export class Snapshot {
  private readonly byName = new Map<string, Sample[]>();

  constructor(
    text: string,
    /** When it was read, ms. */
    readonly at: number,
  ) {
    for (const sample of parse(text)) {
      const of = this.byName.get(sample.name);
      if (of) of.push(sample);
      else this.byName.set(sample.name, [sample]);
    }
  }

  has(name: string): boolean {
    return this.byName.has(name);
  }

  of(name: string, labels: Record<string, string> = {}): Sample[] {
    const fits = (sample: Sample) => Object.entries(labels).every(([key, value]) => sample.labels[key] === value);
    return (this.byName.get(name) ?? []).filter(fits);
  }

  /** Sum over all labels that are not named. */
  sum(name: string, labels?: Record<string, string>): number {
    return this.of(name, labels).reduce((total, { value }) => total + value, 0);
  }

  max(name: string): number {
    return Math.max(0, ...this.of(name).map(({ value }) => value));
  }
}

/** How much a counter grew a second. A counter that fell began again. */
export function rate(before: Snapshot, now: Snapshot, name: string): number {
  const seconds = (now.at - before.at) / 1000;
  const grown = now.sum(name) - before.sum(name);
  return seconds > 0 && grown >= 0 ? grown / seconds : 0;
}

/** Mean of what a histogram took in between; `undefined` if it took nothing. */
export function mean(before: Snapshot, now: Snapshot, name: string): number | undefined {
  const count = now.sum(`${name}_count`) - before.sum(`${name}_count`);
  return count > 0 ? (now.sum(`${name}_sum`) - before.sum(`${name}_sum`)) / count : undefined;
}

/** The value that a share of what a histogram took in between is not above, by linear interpolation in its bucket. */
export function quantile(
  before: Snapshot,
  now: Snapshot,
  name: string,
  share: number,
  labels: Record<string, string> = {},
): number | undefined {
  const counts = new Map<number, number>();
  const add = (from: Snapshot, sign: number) => {
    for (const { labels: of, value } of from.of(`${name}_bucket`, labels)) {
      const bound = of['le'] === '+Inf' ? Infinity : Number(of['le']);
      counts.set(bound, (counts.get(bound) ?? 0) + sign * value);
    }
  };
  add(now, 1);
  add(before, -1);
  const buckets = [...counts].sort(([a], [b]) => a - b);
  const total = buckets.at(-1)?.[1] ?? 0;
  if (total <= 0) return undefined;
  const rank = share * total;
  let [low, below] = [0, 0];
  for (const [bound, count] of buckets) {
    if (count >= rank) {
      if (bound === Infinity) return low;
      return count === below ? bound : low + ((bound - low) * (rank - below)) / (count - below);
    }
    [low, below] = [bound, count];
  }
  return low;
}
