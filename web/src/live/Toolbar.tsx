import { useComputedColorScheme, useMantineColorScheme } from '@mantine/core';
import { CircleHelp, Crosshair, Moon, Pause, Play, RotateCcw, Spline, Sun, UserRoundSearch } from 'lucide-react';
import { Tool } from '../app/Tool';
import { PeopleTool } from '../bodies/PeopleTool';
import { WearTool } from '../bodies/WearTool';
import type { Live } from './live';
import { giveSkin } from './stage-events';
import { report, useLive } from './store';

export function Toolbar({ live, onHelp }: { live: Live; onHelp: () => void }) {
  const tool = useLive((state) => state.tool);
  const follow = useLive((state) => state.follow);
  const time = useLive((state) => state.time);
  const { setColorScheme } = useMantineColorScheme();
  const scheme = useComputedColorScheme('light');
  return (
    <nav className="bar" aria-label="Tools">
      <Tool
        label="Draw a path (P)"
        icon={Spline}
        isOn={tool === 'draw'}
        onClick={() => {
          live.setTool(tool === 'draw' ? 'point' : 'draw');
        }}
      />
      <Tool
        label="Follow the selected character (F)"
        icon={Crosshair}
        isOn={follow}
        onClick={() => {
          live.follow(!follow);
        }}
      />
      <Tool
        label={time.paused ? 'Go on (Space)' : 'Pause (Space)'}
        icon={time.paused ? Play : Pause}
        isOn={time.paused}
        onClick={() => {
          live.setTime(!time.paused, time.speed);
        }}
      />
      <Tool
        label="Find your character (C)"
        icon={UserRoundSearch}
        onClick={() => {
          live.findOwn();
        }}
      />
      <Tool
        label="Camera as at the start (Home)"
        icon={RotateCcw}
        onClick={() => {
          live.resetView();
        }}
      />
      <hr />
      <PeopleTool />
      <WearTool
        onFile={(file) => {
          giveSkin(live, [file]).catch(report);
        }}
      />
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
