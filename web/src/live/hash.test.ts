import { expect, it } from 'vitest';
import { readLink, withoutCamera, writeLink } from './hash';

it('a link comes back as it was written', () => {
  const link = {
    mode: 'live',
    pack: 'unimogen',
    body: 'horse',
    style: 'trot',
    n: 12,
    who: 'unimogen/fox',
    cam: [0, 0.85, 0, 0.6, 1.24, 6.2],
    sel: 'c3',
    open: ['inside', 'numbers'],
    follow: true,
  };
  expect(readLink(writeLink(link))).toEqual(link);
});

it('what is not a camera or a number is left out', () => {
  expect(readLink('#cam=1,2,x&n=many')).toEqual({});
});

it('a link keeps all but its camera', () => {
  expect(withoutCamera('#mode=live&who=unimogen/fox&cam=0,1,0,2,1,9&n=3')).toBe('#mode=live&who=unimogen/fox&n=3');
  expect(withoutCamera('#cam=0,1,0,2,1,9')).toBe('#');
});
