// The calls of the server's API that scenes and objects need.
import type { Api } from '../wire/api';
import { ApiError } from '../wire/api';
import type { TextDocument } from './document';
import { drawnOf } from './document';
import type { Drawn, ObjectDefinition, ObjectResult, Placement, Scene, SceneSummary } from './types';

interface ObjectsResponse {
  results: ObjectResult[];
  revision: string;
}

export class SceneCalls {
  constructor(private readonly api: Api) {}

  scenes = async (): Promise<SceneSummary[]> => (await this.api.get<{ scenes: SceneSummary[] }>('/v1/scenes')).scenes;

  scene = (name: string, withoutColliders = false): Promise<Scene> =>
    this.api.get(`${pathOf(name)}?without_colliders=${withoutColliders}`);

  putEmptyScene = (name: string): Promise<SceneSummary> => this.api.send('PUT', pathOf(name), { scene: { ground: 0 } });

  deleteScene = (name: string): Promise<unknown> => this.api.send('DELETE', pathOf(name));

  definitions = async (): Promise<ObjectDefinition[]> =>
    (await this.api.get<{ definitions: ObjectDefinition[] }>('/v1/objects')).definitions;

  /** What there is to draw of a definition. */
  drawn = async (name: string): Promise<Drawn> => {
    const answer = await this.api.get<{ document: { text: string } }>(
      `/v1/objects/${encodeURIComponent(name)}?format=json`,
    );
    return drawnOf(answer.document.text);
  };

  /** Uploads a document: a definition, or a scene. */
  put = (document: TextDocument): Promise<unknown> => {
    const { kind, name, format, text } = document;
    const path = kind === 'scene' ? pathOf(name) : `/v1/objects/${encodeURIComponent(name)}`;
    return this.api.send('PUT', path, { document: { format, text } });
  };

  add = (scene: string, id: string, definition: string, { position, rotation }: Placement): Promise<void> =>
    this.change(scene, 'add', { objects: [{ id, definition, position, rotation }] });

  move = (scene: string, id: string, { position, rotation }: Placement): Promise<void> =>
    this.change(scene, 'move', { moves: [{ id, position, rotation }] });

  remove = (scene: string, id: string): Promise<void> => this.change(scene, 'remove', { ids: [id] });

  /** Throws the server's words if it refused the object. */
  private async change(scene: string, verb: string, body: object): Promise<void> {
    const { results } = await this.api.send<ObjectsResponse>('POST', `${pathOf(scene)}/${verb}`, body);
    const problem = results.find((result) => result.problem)?.problem;
    if (problem) throw new ApiError(problem.message, 409, problem.reason, problem.field, problem.allowed);
  }
}

function pathOf(scene: string): string {
  return `/v1/scenes/${encodeURIComponent(scene)}`;
}
