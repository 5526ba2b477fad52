import { useComputedColorScheme, useMantineColorScheme } from '@mantine/core';
import {
  CircleHelp,
  Crosshair,
  Moon,
  Move3d,
  PackagePlus,
  RotateCcw,
  Rotate3d,
  Sun,
  UserRoundSearch,
} from 'lucide-react';
import { Tool } from '../app/Tool';
import { PeopleTool } from '../bodies/PeopleTool';
import type { Scenes } from './scenes';
import type { SceneTool } from './store';
import { useScenes } from './store';

const TOOLS = [
  ['move', 'Move the chosen object (M)', Move3d],
  ['turn', 'Turn the chosen object (R)', Rotate3d],
  ['place', 'Put an object where I click (P)', PackagePlus],
] as const satisfies readonly (readonly [SceneTool, string, unknown])[];

export function ScenesToolbar({ scenes, onHelp }: { scenes: Scenes; onHelp: () => void }) {
  const { tool, follow } = useScenes();
  const { setColorScheme } = useMantineColorScheme();
  const scheme = useComputedColorScheme('light');
  return (
    <nav className="bar" aria-label="Tools">
      {TOOLS.map(([name, label, icon]) => (
        <Tool
          key={name}
          label={label}
          icon={icon}
          isOn={tool === name}
          onClick={() => {
            scenes.setTool(tool === name ? 'choose' : name);
          }}
        />
      ))}
      <hr />
      <Tool
        label="Follow the character (F)"
        icon={Crosshair}
        isOn={follow}
        onClick={() => {
          scenes.actors.follow(!follow);
        }}
      />
      <Tool
        label="Find the character (C)"
        icon={UserRoundSearch}
        onClick={() => {
          scenes.findActor();
        }}
      />
      <Tool
        label="Camera as at the start (Home)"
        icon={RotateCcw}
        onClick={() => {
          scenes.resetView();
        }}
      />
      <PeopleTool />
      <Tool
        label="Light or dark (T)"
        icon={scheme === 'dark' ? Sun : Moon}
        onClick={() => {
          setColorScheme(scheme === 'dark' ? 'light' : 'dark');
        }}
      />
      <Tool label="Help (?)" icon={CircleHelp} onClick={onHelp} />
    </nav>
  );
}
