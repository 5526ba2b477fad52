import { describe, expect, it } from 'vitest';
import { mean, parse, quantile, rate, Snapshot } from './prometheus';

const text = (a: number, b: number, c: number, sum: number) => `
# TYPE wait histogram
wait_bucket{class="plan",le="0.01"} ${a}
wait_bucket{class="plan",le="0.1"} ${b}
wait_bucket{class="plan",le="+Inf"} ${c}
wait_sum{class="plan"} ${sum}
wait_count{class="plan"} ${c}
sent_total{model="human",version="1"} ${c * 10}
sent_total{model="g1",version="a \\"b\\""} 5
`;

it('reads names, labels and values', () => {
  const samples = parse(text(1, 2, 3, 0.5));
  expect(samples).toHaveLength(7);
  expect(samples[6]).toEqual({ name: 'sent_total', labels: { model: 'g1', version: 'a "b"' }, value: 5 });
});

describe('between two moments', () => {
  const before = new Snapshot(text(10, 20, 20, 1), 0);
  const now = new Snapshot(text(60, 120, 120, 3), 2000);

  it('rates are a second', () => {
    expect(rate(before, now, 'sent_total')).toBe(500);
    expect(rate(now, before, 'sent_total')).toBe(0);
  });

  it('quantiles are those of what came in between', () => {
    expect(quantile(before, now, 'wait', 0.5, { class: 'plan' })).toBeCloseTo(0.01);
    expect(quantile(before, now, 'wait', 0.75, { class: 'plan' })).toBeCloseTo(0.055);
    expect(quantile(now, now, 'wait', 0.5)).toBeUndefined();
    expect(quantile(before, now, 'wait', 0.5, { class: 'other' })).toBeUndefined();
  });

  it('means are too', () => {
    expect(mean(before, now, 'wait')).toBeCloseTo(0.02);
  });
});
