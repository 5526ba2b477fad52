import { describe, expect, it } from 'vitest';
import type { EventKind } from '../wire/types';
import type { Doing } from './skills';
import { afterAsking, afterEvent, afterLook, isUnderWay, linesOf, NOTHING, withoutAsked } from './skills';

const started = (name: string): EventKind => ({
  started: { instance: name, definition: name, variant: '', approach: '', seed: '1' },
});
const entered = (set: string): EventKind => ({ entered: { instance: 'lie', set } });
const done = (name: string): EventKind => ({ done: { instance: name } });
const interrupted = (name: string): EventKind => ({ interrupted: { instance: name } });

function after(doing: Doing, ...kinds: EventKind[]): Doing {
  return kinds.reduce(afterEvent, doing);
}

const asked = afterAsking(NOTHING, 'lie');
const falling = after(asked, started('lie'), entered('down'));
const lying = afterLook(falling, falling, { kind: 'ACTIVITY_KIND_HELD', instance: 'lie', set: 'down' });

describe('a skill', () => {
  it('goes from its command to its end', () => {
    expect(asked).toEqual({ ...NOTHING, state: 'asked', name: 'lie' });
    expect(falling).toEqual({ ...NOTHING, state: 'doing', name: 'lie', set: 'down' });
    expect(after(falling, done('lie'))).toEqual(NOTHING);
    expect(after(falling, interrupted('lie'))).toEqual(NOTHING);
  });

  it('is held and left', () => {
    expect(lying.state).toBe('held');
    expect(after(lying, entered('up'))).toMatchObject({ state: 'leaving', set: 'up' });
    expect(after(lying, entered('up'), done('lie'))).toEqual(NOTHING);
  });

  it('says what went wrong', () => {
    const failed = (message: string): EventKind => ({ failed: { instance: 'lie', reason: 'NO_PLAN', message } });
    expect(after(falling, failed('no motion'))).toEqual({ ...NOTHING, trouble: 'That could not be done: no motion' });
    expect(after(falling, failed('')).trouble).toBe('That could not be done: NO_PLAN');
  });

  it('has nothing to do with other events', () => {
    expect(after(asked, done('lie'))).toBe(asked);
    expect(after(falling, { fell: { height: 1 } }, {})).toBe(falling);
  });
});

describe('a skill that is asked for', () => {
  it('does not begin after another command', () => {
    expect(withoutAsked(asked)).toEqual(NOTHING);
    expect(withoutAsked(falling)).toBe(falling);
    expect(withoutAsked(NOTHING)).toBe(NOTHING);
    expect(withoutAsked(afterAsking(falling, 'jump'))).toEqual(falling);
  });

  it('comes after the one that is under way', () => {
    const both = afterAsking(lying, 'jump');
    expect(both).toEqual({ ...lying, next: 'jump' });
    const between = after(both, entered('up'), done('lie'));
    expect(between).toEqual({ ...NOTHING, state: 'asked', name: 'jump' });
    expect(after(between, started('jump'))).toEqual({ ...NOTHING, state: 'doing', name: 'jump' });
  });

  it('may be the same again', () => {
    const twice = afterAsking(falling, 'lie');
    expect(after(twice, done('lie'), started('lie'))).toEqual({ ...NOTHING, state: 'doing', name: 'lie' });
  });
});

describe('a look at what the character is about', () => {
  it('leaves a skill that goes on', () => {
    const goes = { kind: 'ACTIVITY_KIND_INTERACTING', instance: 'lie', set: 'down' };
    expect(afterLook(falling, falling, goes)).toBe(falling);
    expect(afterLook(lying, lying, { ...goes, kind: 'ACTIVITY_KIND_HELD' })).toBe(lying);
  });

  it('ends one that the server knows nothing of', () => {
    const walks = { kind: 'ACTIVITY_KIND_LOCOMOTION', instance: '', set: '' };
    expect(afterLook(lying, lying, walks)).toEqual(NOTHING);
    expect(afterLook(lying, lying, undefined)).toEqual(NOTHING);
  });

  it('counts for less than events that came meanwhile', () => {
    const held = { kind: 'ACTIVITY_KIND_HELD', instance: 'lie', set: 'down' };
    const leaving = after(falling, entered('up'));
    expect(afterLook(leaving, falling, held)).toBe(leaving);
    expect(afterLook(NOTHING, falling, held)).toBe(NOTHING);
    const other = after(falling, done('lie'), started('jump'));
    expect(afterLook(other, falling, held)).toBe(other);
    expect(isUnderWay(other)).toBe(true);
  });
});

describe('the lines about a skill', () => {
  it('name what it does and what comes next', () => {
    expect(linesOf(NOTHING)).toEqual([]);
    expect(linesOf(asked)).toEqual(['Is about to do “lie”']);
    expect(linesOf(afterAsking(falling, 'jump'))).toEqual(['Does “lie”', 'Then does “jump”']);
    expect(linesOf(lying)[0]).toMatch(/^Holds “lie” until it walks/);
    expect(linesOf({ ...NOTHING, trouble: 'That could not be done.' })).toEqual(['That could not be done.']);
  });
});
