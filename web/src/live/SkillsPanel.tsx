// What the own character can do where it stands, beside walking: the skills of its pack.
import { Button, Group, Text } from '@mantine/core';
import { useId } from 'react';
import type { Skill } from '../wire/types';
import type { Live } from './live';
import { isUnderWay, linesOf } from './skills';
import { useLive } from './store';

export function Skills({ live }: { live: Live }) {
  const skills = useLive((state) => state.skills);
  const doing = useLive((state) => state.doing);
  const label = useId();
  if (skills.length === 0) return null;
  return (
    <div role="group" aria-labelledby={label}>
      <Text size="xs" fw={500} mb={4} id={label}>
        Skills
      </Text>
      <Group gap={6}>
        {skills.map((skill) => (
          <SkillButton
            key={skill.name}
            skill={skill}
            isOn={isUnderWay(doing) && doing.name === skill.name}
            onClick={() => {
              live.doSkill(skill);
            }}
          />
        ))}
      </Group>
      <div role="status" aria-label="Skill">
        {linesOf(doing).map((line) => (
          <Text size="xs" mt={4} key={line}>
            {line}
          </Text>
        ))}
      </div>
    </div>
  );
}

interface ButtonProps {
  skill: Skill;
  isOn: boolean;
  onClick: () => void;
}

/** The button of a skill. That of a held one stays down until the skill ends. */
function SkillButton({ skill, isOn, onClick }: ButtonProps) {
  return (
    <Button
      size="compact-xs"
      variant={isOn ? 'filled' : 'default'}
      title={skill.description}
      onClick={onClick}
      {...(skill.held ? { 'aria-pressed': isOn } : {})}
    >
      {skill.held ? `${skill.name} · held` : skill.name}
    </Button>
  );
}
