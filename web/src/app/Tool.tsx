import { ActionIcon, Tooltip } from '@mantine/core';
import type { LucideIcon } from 'lucide-react';

interface ToolProps {
  label: string;
  icon: LucideIcon;
  isOn?: boolean;
  onClick: () => void;
}

/** A tool of the bar. */
export function Tool({ label, icon: Icon, isOn, onClick }: ToolProps) {
  return (
    <Tooltip label={label}>
      <ActionIcon
        variant={isOn ? 'filled' : 'subtle'}
        color={isOn ? 'accent' : 'gray'}
        size="lg"
        aria-label={label}
        aria-pressed={isOn}
        onClick={onClick}
      >
        <Icon size={18} />
      </ActionIcon>
    </Tooltip>
  );
}
