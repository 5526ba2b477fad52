// What keyboard and gamepad ask of the own character.

/** A wish: a direction over the ground and how fast. */
export interface Wish {
  /** Right of the camera and away from it, -1 to 1 each. */
  right: number;
  ahead: number;
  runs: boolean;
  /** Turning of the face to the left, -1 to 1. */
  turn: number;
}

const KEYS: Record<string, [keyof Pick<Wish, 'right' | 'ahead' | 'turn'>, number]> = {
  KeyW: ['ahead', 1],
  ArrowUp: ['ahead', 1],
  KeyS: ['ahead', -1],
  ArrowDown: ['ahead', -1],
  KeyD: ['right', 1],
  ArrowRight: ['right', 1],
  KeyA: ['right', -1],
  ArrowLeft: ['right', -1],
  KeyQ: ['turn', 1],
  KeyE: ['turn', -1],
};

/** A stick this near to its middle counts as released; share of its way. */
const DEAD = 0.18;

/** Whether a key press belongs to the control that has the focus. */
export function isTyping(target: EventTarget | null, code: string): boolean {
  if (!(target instanceof HTMLElement)) return false;
  // A choice whose list is closed takes no letters.
  if (target.matches('input[readonly][aria-expanded="false"]')) return !/^(Key|Shift)/.test(code);
  return target.closest('input, textarea, select, [role="slider"], [role="listbox"], [contenteditable]') !== null;
}

export class Controls {
  private readonly held = new Set<string>();
  private readonly abort = new AbortController();

  constructor() {
    const { signal } = this.abort;
    window.addEventListener('keydown', this.down, { signal });
    window.addEventListener('keyup', (event) => this.held.delete(event.code), { signal });
    window.addEventListener(
      'blur',
      () => {
        this.held.clear();
      },
      { signal },
    );
  }

  wish(): Wish {
    const wish: Wish = { right: 0, ahead: 0, runs: false, turn: 0 };
    for (const code of this.held) {
      const [what, sign] = KEYS[code] ?? [];
      if (what && sign) wish[what] += sign;
    }
    wish.runs = this.held.has('ShiftLeft') || this.held.has('ShiftRight');
    addPad(wish);
    return wish;
  }

  dispose(): void {
    this.abort.abort();
  }

  private readonly down = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target, event.code)) return;
    if (event.code in KEYS) {
      // Arrow keys would scroll a panel.
      event.preventDefault();
      this.held.add(event.code);
    }
    if (event.code.startsWith('Shift')) this.held.add(event.code);
  };
}

/** The first gamepad of the standard mapping: left stick goes, right stick faces, A or the right trigger runs. */
function addPad(wish: Wish): void {
  const pad = navigator.getGamepads().find((one) => one?.mapping === 'standard');
  if (!pad) return;
  const [x = 0, y = 0, turn = 0] = pad.axes;
  if (Math.hypot(x, y) > DEAD) {
    wish.right += x;
    wish.ahead -= y;
  }
  if (Math.abs(turn) > DEAD) wish.turn -= turn;
  if (pad.buttons[0]?.pressed || (pad.buttons[7]?.value ?? 0) > 0.5) wish.runs = true;
}

/** The velocity of a wish over the ground, for a camera that looks along `yaw`; `undefined` to stand. */
export function velocityOf(
  wish: Wish,
  yaw: number,
  walk: number,
  run: number,
): { x: number; y: number; z: number } | undefined {
  const length = Math.hypot(wish.right, wish.ahead);
  if (length < 1e-3) return undefined;
  const share = Math.min(1, length) / length;
  const speed = (wish.runs ? run : walk) * share;
  const [sin, cos] = [Math.sin(yaw), Math.cos(yaw)];
  // A camera that looks along +Z has -X at its right.
  const x = (sin * wish.ahead - cos * wish.right) * speed;
  const z = (cos * wish.ahead + sin * wish.right) * speed;
  return { x: round(x), y: 0, z: round(z) };
}

function round(value: number): number {
  return Math.round(value * 100) / 100 + 0;
}
