// Who is in a crowd.
import type { Pack } from '../wire/types';
import type { Bodies } from './bodies';

/** What one member is. */
export interface Role {
  pack: string;
  body: string;
  style: string;
  /** Name of the scene that it lives in. */
  scene?: string;
}

export interface CrowdChoice {
  /** 1 to 200, the own character included. */
  count: number;
  /** Key of the body of all; `mixed` for several. */
  who: string;
  /** A style for all; empty: all styles in turn. */
  style: string;
}

export const MOST_CHARACTERS = 200;

/** Bodies of a pack of many that a mixed crowd shows. */
const ANIMALS = ['horse', 'fox'];

/** Bodies that a mixed crowd has beside the default pack's. */
function guests(packs: readonly Pack[], main: string): { pack: string; body: string }[] {
  const robots = packs.filter((pack) => pack.robot && pack.name !== main && !pack.bodies?.length);
  const robot = robots[0] ? [robots[0], robots[0]].map((pack) => ({ pack: pack.name, body: '' })) : [];
  const animals = packs
    .filter((pack) => pack.name !== main)
    .flatMap((pack) =>
      (pack.bodies ?? [])
        .filter((body) => ANIMALS.includes(body.name))
        .map((body) => ({ pack: pack.name, body: body.name })),
    );
  return [...robot, ...animals];
}

/** The members of a crowd, the own character not among them. */
export async function castOf(bodies: Bodies, choice: CrowdChoice, count: number): Promise<Role[]> {
  const main = bodies.defaultPack;
  if (!main) return [];
  const [wanted, body] = choice.who === 'mixed' ? [main.name, ''] : (choice.who.split('/') as [string, string?]);
  const others = choice.who === 'mixed' ? guests(bodies.packs, main.name) : [];
  const kind = await bodies.of(wanted, body ?? '');
  const moving = kind.styles.filter((style) => !style.is_static && isWalk(style.name, kind.words.length > 0));
  const styles = moving.length > 0 ? moving : kind.styles;
  const roles: Role[] = [];
  for (let i = 0; i < count; i++) {
    // Guests come after the first few, so that small crowds are of the main pack.
    const guest = i >= 4 && (i - 4) % 3 === 0 ? others[(i - 4) / 3] : undefined;
    if (guest) {
      const of = await bodies.of(guest.pack, guest.body);
      roles.push({ pack: guest.pack, body: of.body, style: of.defaultStyle });
      continue;
    }
    const style = choice.style || (styles[i % Math.max(1, styles.length)]?.name ?? '');
    roles.push({ pack: kind.pack, body: kind.body, style });
  }
  return roles;
}

/** Styles that are words name actions too, such as falling: a crowd takes those that move on. */
function isWalk(name: string, isWords: boolean): boolean {
  return !isWords || /walk|run|trot|jog|sprint|march/.test(name);
}
