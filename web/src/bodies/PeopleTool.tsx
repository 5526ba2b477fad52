import { PersonStanding } from 'lucide-react';
import { Tool } from '../app/Tool';
import { togglePeople, usePeople } from './person';

/** Switches between bodies and capsules. */
export function PeopleTool() {
  const isOn = usePeople((state) => state.isOn);
  return <Tool label="Bodies or capsules (V)" icon={PersonStanding} isOn={isOn} onClick={togglePeople} />;
}
