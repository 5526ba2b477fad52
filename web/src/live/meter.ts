// What the page itself takes: for its hooks and the panel of numbers.

/** The last values of something. */
export class Meter {
  private readonly values: Float64Array;
  private at = 0;
  private count = 0;

  constructor(size = 300) {
    this.values = new Float64Array(size);
  }

  add(value: number): void {
    this.values[this.at] = value;
    this.at = (this.at + 1) % this.values.length;
    this.count = Math.min(this.count + 1, this.values.length);
  }

  /** The value that a share of all is not above; 0 without any. */
  quantile(share: number): number {
    const sorted = this.values.slice(0, this.count).sort();
    return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] ?? 0;
  }

  clear(): void {
    this.at = 0;
    this.count = 0;
  }
}

/** Amount a second, over the last seconds. */
export class Rate {
  private readonly events: { at: number; amount: number }[] = [];

  constructor(private readonly over_ms = 3000) {}

  add(at: number, amount: number): void {
    this.events.push({ at, amount });
    this.drop(at);
  }

  perSecond(now: number): number {
    this.drop(now);
    const first = this.events[0];
    if (!first || this.events.length < 2) return 0;
    const sum = this.events.slice(1).reduce((total, event) => total + event.amount, 0);
    return (sum / Math.max(1, now - first.at)) * 1000;
  }

  private drop(now: number): void {
    while (this.events[0] && now - this.events[0].at > this.over_ms) this.events.shift();
  }
}
