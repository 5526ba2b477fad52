import { expect, it } from 'vitest';
import { Way, mayPass } from './way';

it('calls about sessions carry the key of the page, and others nothing', () => {
  const way = new Way('page-1');
  for (const path of ['/v1/sessions', '/v1/sessions/a/peek', '/v1/step', '/v1/tickets', '/v1/scenes'])
    expect(way.headers(path)).toEqual({ 'troupe-session': 'page-1' });
  for (const path of ['/v1/inbetween', '/v1/packs/human/styles?body=fox', '/v1/objects', '/metrics'])
    expect(way.headers(path)).toEqual({});
});

it('calls about a scene go to its server, and the sessions of the page stay', () => {
  const way = new Way('page-1');
  expect(way.to('/v1/step')).toBe(way);
  expect(way.to('/v1/scenes')).toBe(way);
  const toYard = way.to('/v1/scenes/yard/objects?convention=unity');
  expect(toYard.headers('/v1/scenes/yard')).toEqual({ 'troupe-scene': 'yard' });
  expect(toYard.follow({ reason: 'SESSION_ELSEWHERE', allowed: 'b:8080' })).toBe(true);
  expect(toYard.headers('/v1/scenes/yard')).toEqual({ 'troupe-scene': 'yard', 'troupe-server': 'b:8080' });
  expect(way.headers('/v1/step')).toEqual({ 'troupe-session': 'page-1' });
});

it('pages have keys of their own', () => {
  const key = (): string => new Way().headers('/v1/step')['troupe-session']!;
  expect(key()).toMatch(/^page-[0-9a-f]{16}$/);
  expect(key()).not.toBe(key());
});

it('calls follow the server that a problem names until it is lost', () => {
  const way = new Way('page-1');
  const elsewhere = { reason: 'SESSION_ELSEWHERE', allowed: 'b:8080' };
  expect(way.follow(elsewhere)).toBe(true);
  expect(way.follow(elsewhere)).toBe(false);
  expect(way.follow({ reason: 'SESSION_BUSY', allowed: 'c:8080' })).toBe(false);
  expect(way.headers('/v1/step')).toEqual({ 'troupe-session': 'page-1', 'troupe-server': 'b:8080' });
  const url = new URL('ws://host/v1/drive?ticket=1');
  way.mark(url);
  expect(url.search).toBe('?ticket=1&session=page-1&server=b%3A8080');
  expect(way.follow({ reason: 'SESSION_MOVED' })).toBe(true);
  expect(way.headers('/v1/step')).toEqual({ 'troupe-session': 'page-1' });
  way.follow(elsewhere);
  way.forget();
  expect(way.headers('/v1/step')).toEqual({ 'troupe-session': 'page-1' });
});

it('a session that is elsewhere is not gone', () => {
  for (const reason of ['SESSION_BUSY', 'SESSION_ELSEWHERE', 'SESSION_MOVED', 'STORE_UNREACHABLE'])
    expect(mayPass(reason)).toBe(true);
  for (const reason of ['SESSION_EXPIRED', 'UNKNOWN_SESSION', undefined]) expect(mayPass(reason)).toBe(false);
});
