// The reader's options, beside what it understood of a file.
import { Autocomplete, Button, Select, SimpleGrid } from '@mantine/core';
import { ChevronRight } from 'lucide-react';
import { useState } from 'react';
import type { Editor } from './editor';
import type { Choice, Option } from './reading';
import { useEditor, type Reading } from './store';

const LABELS: Readonly<Record<string, string>> = {
  up: 'Up axis',
  unit: 'Unit of length',
  fps: 'Rate, Hz',
  animation: 'Animation',
  root: 'Root joint',
  rest_pose: 'Rest pose',
  leading_pose: 'Leading pose',
  max_slide_m: 'Most slide, m',
  other_bones: 'Other bones',
  quaternion: 'Quaternion',
  degrees: 'Degrees',
  joint_order: 'Joint order',
};

const YES_OR_NO = [
  { value: 'true', label: 'yes' },
  { value: 'false', label: 'no' },
];

/** Reads the file again as the person says. Closed until it is asked for, or until an error names an option. */
export function ReadAs({ editor }: { editor: Editor }) {
  const reading = useEditor((state) => state.reading);
  if (!reading) return null;
  const { file, isOpen } = reading;
  return (
    <div className="read-as">
      <Button
        size="compact-xs"
        variant="subtle"
        fullWidth
        justify="flex-start"
        aria-expanded={isOpen}
        leftSection={<ChevronRight size={13} />}
        onClick={() => {
          useEditor.setState({ reading: { ...reading, isOpen: !isOpen } });
        }}
      >
        Read {file} as …
      </Button>
      {isOpen && (
        <SimpleGrid cols={2} spacing="xs" verticalSpacing={4} role="group" aria-label="How the file is read">
          {reading.options
            .filter((option) => isShown(option, reading))
            .map((option) => (
              <Control
                key={option.name}
                option={option}
                reading={reading}
                onChange={(value) => {
                  void editor.readAs(option.name, value);
                }}
              />
            ))}
        </SimpleGrid>
      )}
    </div>
  );
}

/** Only a file with several animations leaves them open. */
function isShown({ name }: Option, { animations }: Reading): boolean {
  return name !== 'animation' || animations.length > 1;
}

function Control({
  option: { name, takes, values },
  reading: { given, asked, animations },
  onChange,
}: {
  option: Option;
  reading: Reading;
  onChange: (value: string | undefined) => void;
}) {
  const choice = asked.find(({ option }) => option === name);
  const shared = {
    label: LABELS[name] ?? name,
    size: 'xs',
    placeholder: name === 'other_bones' ? 'no' : 'from the file',
    error: choice && decides(choice, takes),
  };
  if (takes === 'name' || takes === 'flag' || name === 'animation') {
    const names = name === 'animation' ? animations : values;
    return (
      <Select
        {...shared}
        clearable
        data={takes === 'flag' ? YES_OR_NO : [...names]}
        value={given[name] ?? null}
        onChange={(value) => {
          onChange(value ?? undefined);
        }}
      />
    );
  }
  return (
    <Typed
      {...shared}
      known={[...new Set([...(choice?.values ?? []), ...values])]}
      value={given[name] ?? ''}
      onChange={onChange}
    />
  );
}

/** A field that is taken when it is left, with Enter, or as one of the known values. */
function Typed({
  known,
  value,
  onChange,
  ...shared
}: {
  label: string;
  size: string;
  placeholder: string;
  error: string | undefined;
  known: readonly string[];
  value: string;
  onChange: (value: string | undefined) => void;
}) {
  const [text, setText] = useState(value);
  const [shown, setShown] = useState(value);
  if (shown !== value) {
    setShown(value);
    setText(value);
  }
  const take = (now: string) => {
    if (now.trim() !== value) onChange(now.trim() || undefined);
  };
  return (
    <Autocomplete
      {...shared}
      data={[...known]}
      value={text}
      onChange={setText}
      onOptionSubmit={take}
      onBlur={() => {
        take(text);
      }}
      onKeyDown={({ key }) => {
        if (key === 'Enter') take(text);
      }}
    />
  );
}

function decides({ values }: Choice, takes: Option['takes']): string {
  return takes === 'flag' || values.length === 0 ? 'decides' : `decides: ${values.join(' or ')}`;
}
