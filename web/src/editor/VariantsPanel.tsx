// The variants: which one, how they stand, what the model made on the way, and files.
import { Button, Checkbox, Group, Menu, SegmentedControl, Stack, Text } from '@mantine/core';
import { Check, Download } from 'lucide-react';
import { useState } from 'react';
import { Panel, Row } from '../app/Panel';
import { tintCss } from '../app/theme';
import { STAGES } from '../inside/overlays';
import { StageLegend, TokenGrid } from '../inside/InsidePanel';
import { report } from '../live/store';
import type { Intermediates, Pack } from '../wire/types';
import type { Editor, Scope } from './editor';
import { formatsFor, type Format } from './files';
import { variantTint } from './scene';
import type { Layout } from './store';
import { chosenVariant, docOf, useEditor } from './store';

const LAYOUTS: { value: Layout; label: string }[] = [
  { value: 'one', label: 'One' },
  { value: 'over', label: 'Over each other' },
  { value: 'beside', label: 'Side by side' },
];

export function VariantsPanel({ editor }: { editor: Editor }) {
  const [isOpen, setOpen] = useState(true);
  const { filled, chosen, layout, showsCaptured, showsInside, packs, rig } = useEditor();
  if (!filled) return null;
  const inside = filled.variants[chosen]?.intermediates;
  const pack = packs.find((one) => one.name === rig?.pack);
  return (
    <Panel
      title="Variants"
      id="variants"
      isOpen={isOpen}
      onToggle={() => {
        setOpen(!isOpen);
      }}
    >
      <Stack gap="sm">
        <div role="radiogroup" aria-label="Variant">
          {filled.variants.map(({ seed, clip }, v) => (
            <button
              key={seed}
              type="button"
              role="radio"
              aria-checked={v === chosen}
              className="variant"
              onClick={() => {
                editor.choose(v);
              }}
            >
              <i style={{ background: tintCss(variantTint(v)) }} />
              Seed {seed}
              <small>{clip.frames} frames</small>
            </button>
          ))}
        </div>
        <SegmentedControl
          size="xs"
          fullWidth
          aria-label="How variants stand"
          data={LAYOUTS}
          value={layout}
          onChange={(value) => {
            useEditor.setState({ layout: value });
          }}
        />
        <Checkbox
          size="xs"
          label="As captured, in grey"
          checked={showsCaptured}
          onChange={({ currentTarget }) => {
            useEditor.setState({ showsCaptured: currentTarget.checked });
          }}
        />
        <Checkbox
          size="xs"
          label="What each stage made"
          checked={showsInside}
          onChange={({ currentTarget }) => {
            useEditor.setState({ showsInside: currentTarget.checked });
          }}
        />
        {showsInside && inside && <Inside inside={inside} pack={pack} />}
        <Button
          size="xs"
          variant="default"
          leftSection={<Check size={14} />}
          onClick={() => {
            editor.apply();
          }}
        >
          Put it into the clip
        </Button>
        <Text size="xs" c="dimmed">
          {filled.pack} {filled.version}, {filled.variants.length} in one request, {(filled.total_us / 1000).toFixed(1)}{' '}
          ms
        </Text>
      </Stack>
    </Panel>
  );
}

/** Predicted length, tokens, and which line is which. */
function Inside({ inside, pack }: { inside: Intermediates; pack: Pack | undefined }) {
  const best = inside.token_count_probabilities.reduce((a, p, i, all) => (p > (all[a] ?? 0) ? i : a), 0);
  const share = inside.token_count_probabilities[best] ?? 0;
  return (
    <Stack gap={6}>
      <Row label="Root module's length" value={`${inside.predicted_frame_count} frames`} />
      <Row label="Likeliest token count" value={`${best + 3}, ${(share * 100).toFixed(0)} %`} />
      <TokenGrid tokens={inside.tokens} heads={pack?.heads ?? 1} codes={pack?.codes ?? 1} />
      <StageLegend stages={STAGES.filter(({ name }) => name === 'r_g3' || name === 'r_g4')} />
    </Stack>
  );
}

export function ExportPanel({ editor }: { editor: Editor }) {
  const [isOpen, setOpen] = useState(true);
  const rig = useEditor((state) => state.rig);
  const doc = useEditor(docOf);
  const variant = useEditor(chosenVariant);
  if (!doc || !rig) return null;
  const items = (scope: Scope) =>
    formatsFor(rig).map((format: Format) => (
      <Menu.Item
        key={format}
        onClick={() => {
          editor.export(format, scope).catch(report);
        }}
      >
        {format === 'glb' ? 'glb' : format.toUpperCase()}
      </Menu.Item>
    ));
  const menu = (scope: Scope, label: string, isOff: boolean) => (
    <Menu width={110} position="top">
      <Menu.Target>
        <Button size="xs" variant="default" disabled={isOff} leftSection={<Download size={14} />}>
          {label}
        </Button>
      </Menu.Target>
      <Menu.Dropdown>{items(scope)}</Menu.Dropdown>
    </Menu>
  );
  return (
    <Panel
      title="Export"
      id="export"
      isOpen={isOpen}
      onToggle={() => {
        setOpen(!isOpen);
      }}
    >
      <Group grow gap="xs">
        {menu('segment', 'The gap', !variant)}
        {menu('clip', 'Whole clip', false)}
      </Group>
    </Panel>
  );
}
