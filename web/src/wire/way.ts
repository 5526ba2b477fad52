// Which server gets the page's calls about sessions, if several servers share them
// (docs/cluster.md).

const ELSEWHERE = 'SESSION_ELSEWHERE';
const MOVED = 'SESSION_MOVED';
/** Calls that any server answers: they carry no route. */
const ANYWHERE = /^\/(metrics|v1\/(inbetween|generate|describe|packs|skeletons|objects))(\/|\?|$)/;
const SCENE = /^\/v1\/scenes\/([^/?]+)/;

/** Why a session is not on the server that was asked, and which one has it. */
export interface Elsewhere {
  reason?: string | undefined;
  /** The address of the server that has it. */
  allowed?: string | undefined;
}

/** Whether the session is there, and can be resumed a little later. */
export function mayPass(reason: string | undefined): boolean {
  return reason === 'SESSION_BUSY' || reason === ELSEWHERE || reason === MOVED || reason === 'STORE_UNREACHABLE';
}

/** Whether another server has the session. */
export function isElsewhere(reason: string | undefined): boolean {
  return reason === ELSEWHERE || reason === MOVED;
}

/** All sessions of a page are on one server, because they share a stream. */
export class Way {
  private server = '';

  /** `key`: a name that no other page has, or the scene that a call is about. */
  constructor(
    private readonly key = `page-${Array.from(crypto.getRandomValues(new Uint32Array(2)), hex).join('')}`,
    private readonly header: 'troupe-session' | 'troupe-scene' = 'troupe-session',
  ) {}

  /** The way of a call. A scene may be on another server than the page's sessions. */
  to(path: string): Way {
    // As it is in the path. A name with other characters is no scene's.
    const scene = SCENE.exec(path)?.[1];
    return scene === undefined ? this : new Way(scene, 'troupe-scene');
  }

  /** Headers of a call. */
  headers(path: string): Record<string, string> {
    if (ANYWHERE.test(path)) return {};
    return { [this.header]: this.key, ...(this.server ? { 'troupe-server': this.server } : {}) };
  }

  /** A WebSocket has no headers, but a query. */
  mark(url: URL): void {
    url.searchParams.set('session', this.key);
    if (this.server) url.searchParams.set('server', this.server);
  }

  /** Sends calls to the server that a problem names. Says whether that is another one than before. */
  follow(problem: Elsewhere): boolean {
    if (!isElsewhere(problem.reason)) return false;
    // After a move any server knows where the session is.
    const owner = problem.reason === MOVED ? '' : (problem.allowed ?? '');
    const isNew = owner === '' || owner !== this.server;
    this.server = owner;
    return isNew;
  }

  /** The server is lost: the router decides again. */
  forget(): void {
    this.server = '';
  }
}

function hex(number: number): string {
  return number.toString(16).padStart(8, '0');
}
