// The server's HTTP API.
import type {
  Command,
  CommandResult,
  InBetweenRequest,
  InBetweenResponse,
  Keyframe,
  Pack,
  PeekResponse,
  Session,
  SessionOptions,
  SessionProblem,
  StepResponse,
  Style,
} from './types';
import { Way } from './way';

const KEY = 'troupe-key';
/** Most servers that a call is sent to after the first. */
const MOVES = 2;

/** Begins again without the key, so that the page asks for one. */
export function askForAnotherKey(): void {
  sessionStorage.removeItem(KEY);
  location.reload();
}

/** The server's own words for what went wrong. */
export class ApiError extends Error {
  override name = 'ApiError';

  constructor(
    message: string,
    /** HTTP status; 0 without an answer. */
    readonly status: number,
    /** A word for the kind of error. */
    readonly reason = '',
    readonly field = '',
    readonly allowed = '',
  ) {
    super(message);
  }

  /** Whether another key may help. */
  get isAboutKeys(): boolean {
    return this.status === 401 || this.status === 403;
  }

  /** Whether the server is not there, or not ready: the same call may succeed later. */
  get mayPass(): boolean {
    return this.status === 0 || this.status === 502 || this.status === 503 || this.status === 504;
  }
}

/** Asks the person for a key; `undefined` if there is none to give. */
export type AskForKey = (wrong: boolean) => Promise<string | undefined>;

interface ErrorBody {
  error?: { message?: string; reason?: string; field?: string; allowed?: string };
}

async function errorOf(answer: Response): Promise<ApiError> {
  const text = await answer.text();
  try {
    const { error } = JSON.parse(text) as ErrorBody;
    const message = error?.message ?? `the server answered ${answer.status}`;
    return new ApiError(message, answer.status, error?.reason, error?.field, error?.allowed);
  } catch {
    return new ApiError(text.trim().slice(0, 300) || `the server answered ${answer.status}`, answer.status);
  }
}

export class Api {
  readonly way = new Way();
  private asking: Promise<string | undefined> | undefined;
  /** The person has no key to give, and is not asked again. */
  private isDeclined = false;

  constructor(private readonly askForKey: AskForKey) {}

  get hasKey(): boolean {
    return sessionStorage.getItem(KEY) !== null;
  }

  packs = async (): Promise<Pack[]> => (await this.get<{ packs: Pack[] }>('/v1/packs')).packs;

  /** A pack with the skeletons of its bodies. */
  pack = (name: string): Promise<Pack> => this.get(`/v1/packs/${encodeURIComponent(name)}`);

  styles = (pack: string, body: string): Promise<{ styles: Style[]; default_style: string }> =>
    this.get(`/v1/packs/${encodeURIComponent(pack)}/styles${body ? `?body=${encodeURIComponent(body)}` : ''}`);

  putStyle = (pack: string, body: string, name: string, style: object): Promise<Style> => {
    const of = body ? `?body=${encodeURIComponent(body)}` : '';
    return this.send('PUT', `/v1/packs/${encodeURIComponent(pack)}/styles/${encodeURIComponent(name)}${of}`, style);
  };

  createSessions = async (sessions: SessionOptions[]): Promise<Session[]> =>
    (await this.send<{ sessions: Session[] }>('POST', '/v1/sessions', { sessions })).sessions;

  resumeSessions = (
    sessions: { session_id: string; frame?: number; pose?: Keyframe }[],
  ): Promise<{ sessions: { session: Session | null; restored: boolean }[]; problems: SessionProblem[] }> =>
    this.send('POST', '/v1/sessions/resume', { sessions });

  session = (id: string): Promise<Session> => this.get(`/v1/sessions/${encodeURIComponent(id)}`);

  closeSession = async (id: string): Promise<void> => {
    await this.call('DELETE', `/v1/sessions/${encodeURIComponent(id)}`);
  };

  commands = (commands: Command[]): Promise<{ results: CommandResult[] }> =>
    this.send('POST', '/v1/commands', { commands });

  /** Advances sessions by one frame, in the compact encoding. */
  step = (session_ids: string[], commands: Command[]): Promise<StepResponse> =>
    this.send('POST', '/v1/step', { session_ids, frames: 1, encoding: 'compact', commands });

  /** Advances sessions by several frames, as plain numbers. */
  frames = (session_ids: string[], frames: number, commands: Command[]): Promise<StepResponse> =>
    this.send('POST', '/v1/step', { session_ids, frames, encoding: 'f32', commands });

  inBetween = (request: InBetweenRequest): Promise<InBetweenResponse> => this.send('POST', '/v1/inbetween', request);

  peek = (id: string): Promise<PeekResponse> => this.get(`/v1/sessions/${encodeURIComponent(id)}/peek`);

  metrics = async (): Promise<string> => (await this.call('GET', '/metrics')).text();

  /** A ticket for one stream; `undefined` if the server asks for no keys. */
  ticket = async (): Promise<string | undefined> => {
    if (!this.hasKey) return undefined;
    try {
      return (await this.send<{ ticket: string }>('POST', '/v1/tickets', {})).ticket;
    } catch (error) {
      if (error instanceof ApiError && error.reason === 'NO_KEYS') return undefined;
      throw error;
    }
  };

  get = <T>(path: string): Promise<T> => this.json<T>(this.call('GET', path));

  send = <T>(method: string, path: string, body?: object): Promise<T> => this.json<T>(this.call(method, path, body));

  private json = async <T>(answer: Promise<Response>): Promise<T> => (await (await answer).json()) as T;

  private async call(method: string, path: string, body?: object): Promise<Response> {
    const way = this.way.to(path);
    for (let moves = 0; ;) {
      const key = sessionStorage.getItem(KEY);
      const headers = way.headers(path);
      if (key) headers['authorization'] = `Bearer ${key}`;
      if (body) headers['content-type'] = 'application/json';
      const options = { method, headers, body: body ? JSON.stringify(body) : null };
      // What is closed while the page goes away is sent to the end.
      const answer = await fetch(path, { ...options, keepalive: method === 'DELETE' }).catch(() => {
        throw new ApiError('the server cannot be reached', 0);
      });
      if (answer.ok) return answer;
      const error = await errorOf(answer);
      // Another server has the session or the scene.
      if (way.follow(error) && moves++ < MOVES) continue;
      if (error.status !== 401 || !(await this.renewKey(key))) throw error;
    }
  }

  /** Asks for a key once for all calls that wait for one. */
  private async renewKey(used: string | null): Promise<boolean> {
    if (sessionStorage.getItem(KEY) !== used) return true;
    if (this.isDeclined) return false;
    this.asking ??= this.askForKey(used !== null).finally(() => {
      this.asking = undefined;
    });
    const key = await this.asking;
    if (key) sessionStorage.setItem(KEY, key);
    else this.isDeclined = true;
    return key !== undefined;
  }
}
