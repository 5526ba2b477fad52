import { expect, it } from 'vitest';
import { describe as says } from './log';

it('says what began, and from where', () => {
  const started = { instance: 'stool', definition: 'seat', variant: 'upright', approach: 'front', seed: '1' };
  expect(says({ started })?.text).toBe('started upright at stool from front');
  expect(says({ started: { ...started, approach: '' } })?.text).toBe('started upright at stool');
});

it('says how far off the networks were', () => {
  const error = { joint_m: 0.18, root_m: 0.01, heading_deg: 2 };
  const reached = { instance: 'cup', set: 'reach', keyframe: 0, after: error, early_frames: 0 };
  expect(says({ reached: { ...reached, before: error } })?.text).toBe(
    'reached reach of cup (18 cm off before it was pinned)',
  );
  expect(says({ reached: { ...reached, early_frames: 4 } })?.text).toBe('reached reach of cup, 4 frames early');
});

it('marks failures, in the words of the server', () => {
  const failed = { instance: 'cup', reason: 'BLOCKED', message: 'the way is blocked' };
  expect(says({ failed })).toEqual({ text: 'failed at cup: the way is blocked', failed: true });
  expect(says({ failed: { ...failed, message: '' } })?.text).toBe('failed at cup: BLOCKED');
});
