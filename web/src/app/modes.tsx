// The modes of the viewer. A mode that is not here is not shown.
import type { LucideIcon } from 'lucide-react';
import { Armchair, Footprints, Waypoints } from 'lucide-react';
import type { ComponentType } from 'react';
import { EditorMode } from '../editor/EditorMode';
import { LiveMode } from '../live/LiveMode';
import { ScenesMode } from '../scenes/ScenesMode';
import type { Stage } from '../stage/types';
import type { Api } from '../wire/api';

/** What a mode gets. The stage is empty when it comes, and it leaves it so. */
export interface ModeProps {
  stage: Stage;
  api: Api;
}

export interface Mode {
  /** Its name in links. */
  id: string;
  label: string;
  icon: LucideIcon;
  /** Its panels and tools, over the stage. It renders the stage while it is there. */
  View: ComponentType<ModeProps>;
}

export const MODES: readonly Mode[] = [
  { id: 'live', label: 'Live', icon: Footprints, View: LiveMode },
  { id: 'scenes', label: 'Scenes', icon: Armchair, View: ScenesMode },
  { id: 'inbetween', label: 'In-between', icon: Waypoints, View: EditorMode },
];
