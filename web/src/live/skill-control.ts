// Has the own character do skills, and keeps the page's state of them.
import type { Api } from '../wire/api';
import type { EventKind, Intent, Skill } from '../wire/types';
import type { Character } from './character';
import type { Doing } from './skills';
import { afterAsking, afterEvent, afterLook, isUnderWay, NOTHING, withoutAsked } from './skills';
import { useLive } from './store';

/** What it needs of the live mode. */
export interface SkillHost {
  readonly api: Api;
  readonly own: Character | undefined;
  /** Sends the own character a command. Returns its number. */
  tell(intent: Intent): number;
  /** A skill is over: what the keys say now counts. */
  onSkillOver(): void;
}

export class SkillControl {
  /** Number of the command that asked for a skill last. */
  private asked = 0;

  constructor(private readonly host: SkillHost) {}

  /** Asks for a skill, or ends it if it is held now. */
  ask({ name, held }: Skill): void {
    const { doing } = useLive.getState();
    if (held && doing.name === name && (doing.state === 'doing' || doing.state === 'held')) {
      this.forgetAsked();
      this.host.tell({ end_interaction: {} });
      return;
    }
    set(afterAsking(doing, name));
    this.asked = this.host.tell({ skill: { name } });
  }

  /** Another command comes after a skill that has not begun: it will not begin. */
  forgetAsked(): void {
    set(withoutAsked(useLive.getState().doing));
  }

  /** The server refuses a command of the own character. */
  onRefused(sequence: number | undefined): void {
    if (sequence === this.asked) this.forgetAsked();
  }

  onEvent(kind: EventKind): void {
    this.become(afterEvent(useLive.getState().doing, kind));
    const { doing } = useLive.getState();
    if (kind.reached && doing.state === 'doing' && isHeldOne(doing)) this.look();
  }

  /** The stream is there again: events may have been missed. */
  onConnected(): void {
    if (isUnderWay(useLive.getState().doing)) this.look();
  }

  /** The own character is another one now, or begins again. */
  reset(): void {
    set(NOTHING);
  }

  /** Asks the server what the character is about: events do not say at which keyframe a skill is held. */
  private look(): void {
    const { own, api } = this.host;
    if (!own) return;
    const looked = useLive.getState().doing;
    api.session(own.session).then(
      ({ activity }) => {
        if (this.host.own === own) this.become(afterLook(useLive.getState().doing, looked, activity));
      },
      // Then the skill is shown as one that goes on.
      () => undefined,
    );
  }

  private become(doing: Doing): void {
    const before = useLive.getState().doing;
    set(doing);
    if (isUnderWay(before) && !isUnderWay(doing)) this.host.onSkillOver();
  }
}

function set(doing: Doing): void {
  if (doing !== useLive.getState().doing) useLive.setState({ doing });
}

function isHeldOne({ name }: Doing): boolean {
  return useLive.getState().skills.some((skill) => skill.name === name && skill.held);
}
