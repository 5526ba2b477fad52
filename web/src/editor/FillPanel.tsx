// How the gap is filled, and what went wrong.
import { Alert, Button, Checkbox, Group, NumberInput, Slider, Stack, Text } from '@mantine/core';
import { Sparkles } from 'lucide-react';
import { useState } from 'react';
import { Panel } from '../app/Panel';
import type { Editor } from './editor';
import type { FillForm } from './store';
import { docOf, isStale, MOST_POSE_STEPS, MOST_TEMPERATURE, MOST_VARIANTS, useEditor } from './store';

function set(change: Partial<FillForm>): void {
  useEditor.setState(({ form }) => ({ form: { ...form, ...change } }));
}

function whole(value: string | number, otherwise: number): number {
  return typeof value === 'number' && Number.isInteger(value) ? value : otherwise;
}

export function FillPanel({ editor }: { editor: Editor }) {
  const [isOpen, setOpen] = useState(true);
  const form = useEditor((state) => state.form);
  const isBusy = useEditor((state) => state.isBusy);
  const doc = useEditor(docOf);
  const filled = useEditor((state) => state.filled);
  const stale = useEditor(isStale);
  if (!doc) return null;
  return (
    <Panel
      title="Fill"
      id="fill"
      isOpen={isOpen}
      onToggle={() => {
        setOpen(!isOpen);
      }}
    >
      <Stack gap="sm">
        <Group grow gap="xs">
          <NumberInput
            label="Variants"
            size="xs"
            min={1}
            max={MOST_VARIANTS}
            clampBehavior="strict"
            allowDecimal={false}
            value={form.count}
            onChange={(value) => {
              set({ count: whole(value, form.count) });
            }}
          />
          <NumberInput
            label="First seed"
            size="xs"
            min={0}
            max={Number.MAX_SAFE_INTEGER - MOST_VARIANTS}
            clampBehavior="strict"
            allowDecimal={false}
            value={form.firstSeed}
            onChange={(value) => {
              set({ firstSeed: whole(value, form.firstSeed) });
            }}
          />
          <NumberInput
            label="Pose steps"
            size="xs"
            min={1}
            max={MOST_POSE_STEPS}
            clampBehavior="strict"
            allowDecimal={false}
            value={form.poseSteps}
            onChange={(value) => {
              set({ poseSteps: whole(value, form.poseSteps) });
            }}
          />
        </Group>
        <div>
          <Group justify="space-between">
            <Text size="xs" fw={500}>
              Temperature
            </Text>
            <Text size="xs" c="dimmed">
              {form.temperature === 0 ? '0: all variants alike' : form.temperature.toFixed(2)}
            </Text>
          </Group>
          <Slider
            size="sm"
            min={0}
            max={MOST_TEMPERATURE}
            step={0.05}
            label={null}
            thumbLabel="Temperature"
            value={form.temperature}
            onChange={(temperature) => {
              set({ temperature });
            }}
          />
        </div>
        <Checkbox
          size="xs"
          label="Keep standing feet still"
          checked={form.holdFeet}
          onChange={({ currentTarget }) => {
            set({ holdFeet: currentTarget.checked });
          }}
        />
        <Checkbox
          size="xs"
          label="The model chooses the length"
          checked={form.modelsLength}
          onChange={({ currentTarget }) => {
            set({ modelsLength: currentTarget.checked });
          }}
        />
        <Button
          size="sm"
          loading={isBusy}
          variant={filled && !stale ? 'light' : 'filled'}
          leftSection={<Sparkles size={15} />}
          onClick={() => {
            void editor.fill();
          }}
        >
          {filled && stale ? 'Fill again, it has changed' : 'Fill the gap'}
        </Button>
        <TroubleAlert isOfFile={false} />
      </Stack>
    </Panel>
  );
}

/** What went wrong, with the field and what it may be: everything, or with a file or a request alone. */
export function TroubleAlert({ isOfFile }: { isOfFile?: boolean }) {
  const trouble = useEditor((state) => state.trouble);
  if (!trouble || trouble.isOfFile !== (isOfFile ?? trouble.isOfFile)) return null;
  return (
    <Alert
      color="red"
      variant="light"
      p="xs"
      title={trouble.field || undefined}
      withCloseButton
      closeButtonLabel="Close"
      onClose={() => {
        useEditor.setState({ trouble: undefined });
      }}
    >
      <Text size="xs" style={{ overflowWrap: 'anywhere' }}>
        {trouble.message}
      </Text>
    </Alert>
  );
}
