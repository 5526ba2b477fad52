import { describe, expect, it } from 'vitest';
import { after, SILENT, unknownNote, whyMute } from './words';
import type { Saying, Speaker } from './words';

const SKELETON = { names: ['Hips', 'Spine'], parents: Int16Array.of(-1, 0), offsets: new Float32Array(6) };

function speaker(name: string, ...names: string[]): Speaker {
  return { name, joints: names.map((joint, i) => ({ name: joint, parent: i - 1 })) };
}

describe('who takes words', () => {
  it('is a body with the joints of a pack of words', () => {
    expect(whyMute([speaker('dog', 'Tail'), speaker('words', 'Hips', 'Spine')], SKELETON)).toBeUndefined();
  });

  it('says why it does not', () => {
    expect(whyMute([], SKELETON)).toBe('No pack of this server makes motion from text.');
    const others = [speaker('dog', 'Hips', 'Tail'), speaker('cat', 'Hips')];
    expect(whyMute(others, SKELETON)).toBe('This body cannot act out words: dog, cat has other joints.');
  });
});

describe('a sentence', () => {
  const waiting: Saying = { ...SILENT, state: 'waiting', text: 'wave' };
  const started = { performing: { sequence: '7', text: 'wave', pack: 'words', unknown_words: ['zog', 'zig'] } };
  const ended = (reason: string, message = '', sequence = '7') => ({ performed: { sequence, reason, message } });

  it('is acted out from its first frames to its end', () => {
    const performing = after(waiting, started, 7);
    expect(performing).toEqual({ state: 'performing', text: 'wave', unknown: ['zog', 'zig'], trouble: '' });
    expect(after(performing, ended('DONE'), 7)).toEqual({ ...performing, state: 'silent' });
    expect(after(performing, ended('INTERRUPTED'), 7).trouble).toBe('');
  });

  it('says what went wrong', () => {
    expect(after(waiting, ended('FAILED', 'no frames'), 7)).toMatchObject({
      state: 'silent',
      trouble: 'That could not be acted out: no frames',
    });
    expect(after(waiting, ended('LATE'), 7).trouble).toBe('The server is too busy for sentences.');
  });

  it('is not that of another command', () => {
    expect(after(waiting, started, 8)).toBe(waiting);
    expect(after(waiting, ended('INTERRUPTED', '', '6'), 7)).toBe(waiting);
    expect(after(waiting, { fell: { height: 1 } }, 7)).toBe(waiting);
    expect(after(waiting, {}, 7)).toBe(waiting);
  });

  it('names words that are not known', () => {
    expect(unknownNote([])).toBe('');
    expect(unknownNote(['zog', 'zig'])).toBe('The pack has not learnt: zog, zig');
  });
});
