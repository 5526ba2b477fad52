// Deep links: what the address says after its #.

export interface Link {
  mode?: string;
  pack?: string;
  body?: string;
  style?: string;
  /** Characters. */
  n?: number;
  /** Who they are: `mixed`, or the key of a body. */
  who?: string;
  /** State of the camera: six numbers. */
  cam?: number[];
  sel?: string;
  /** Name of a scene. */
  scene?: string;
  /** Open panels: `inside`, `numbers`. */
  open?: string[];
  follow?: boolean;
}

export function readLink(hash: string): Link {
  const of = new URLSearchParams(hash.replace(/^#/, ''));
  const link: Link = {};
  for (const name of ['mode', 'pack', 'body', 'style', 'who', 'sel', 'scene'] as const) {
    const value = of.get(name);
    if (value !== null) link[name] = value;
  }
  const n = Number(of.get('n'));
  if (of.has('n') && Number.isFinite(n)) link.n = Math.round(n);
  const cam = of.get('cam')?.split(',').map(Number);
  if (cam?.length === 6 && cam.every(Number.isFinite)) link.cam = cam;
  const open = of.get('open');
  if (open) link.open = open.split(',');
  if (of.has('follow')) link.follow = of.get('follow') === '1';
  return link;
}

/** The link without its camera: who opens it gets the view with which the mode begins. */
export function withoutCamera(hash: string): string {
  const of = new URLSearchParams(hash.replace(/^#/, ''));
  of.delete('cam');
  return hashOf(of);
}

export function writeLink(link: Link): string {
  const of = new URLSearchParams();
  const put = (name: string, value: string | undefined) => {
    if (value) of.set(name, value);
  };
  put('mode', link.mode);
  put('pack', link.pack);
  put('body', link.body);
  put('style', link.style);
  put('n', link.n?.toString());
  put('who', link.who);
  put('scene', link.scene);
  put('sel', link.sel);
  put('open', link.open?.join(','));
  put('follow', link.follow ? '1' : undefined);
  put('cam', link.cam?.map((value) => Number(value.toFixed(2))).join(','));
  return hashOf(of);
}

function hashOf(of: URLSearchParams): string {
  return `#${of.toString().replaceAll('%2C', ',').replaceAll('%2F', '/')}`;
}
