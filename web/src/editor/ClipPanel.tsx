// Which pack, which clip, and the keyframes at the gap's end.
import {
  Alert,
  Button,
  Checkbox,
  FileButton,
  Group,
  Select,
  Stack,
  Table,
  Text,
  Tooltip,
  ActionIcon,
  SegmentedControl,
} from '@mantine/core';
import { FolderOpen, Footprints, Minus, Plus, RotateCcw } from 'lucide-react';
import { useState } from 'react';
import { Panel } from '../app/Panel';
import { Faults, FiguresTable } from '../bodies/FiguresTable';
import { report } from '../live/store';
import type { Editor } from './editor';
import { ROOT } from './editor';
import { TroubleAlert } from './FillPanel';
import { ACCEPTED } from './files';
import { ReadAs } from './ReadAs';
import { targetFrame } from './segment';
import { docOf, useEditor } from './store';

export function OpenButtons({ editor }: { editor: Editor }) {
  const isBusy = useEditor((state) => state.isBusy);
  return (
    <Group gap="xs" grow>
      <FileButton
        accept={ACCEPTED}
        onChange={(file) => {
          if (file) void editor.open(file);
        }}
      >
        {(props) => (
          <Button {...props} size="xs" px={6} variant="default" leftSection={<FolderOpen size={14} />}>
            Open …
          </Button>
        )}
      </FileButton>
      <Tooltip label="The server makes a character of the pack walk">
        <Button
          size="xs"
          px={6}
          variant="default"
          loading={isBusy}
          leftSection={<Footprints size={14} />}
          onClick={() => {
            void editor.walk();
          }}
        >
          Make a walk
        </Button>
      </Tooltip>
    </Group>
  );
}

export function ClipPanel({ editor }: { editor: Editor }) {
  const [isOpen, setOpen] = useState(true);
  const { packs, rig, file } = useEditor();
  const doc = useEditor(docOf);
  return (
    <Panel
      title="Clip"
      id="clip"
      isOpen={isOpen}
      onToggle={() => {
        setOpen(!isOpen);
      }}
    >
      <Stack gap="sm">
        <Select
          label="Pack"
          size="xs"
          data={packs.map((pack) => pack.name)}
          value={rig?.pack ?? null}
          allowDeselect={false}
          onChange={(name) => {
            if (name) editor.choosePack(name).catch(report);
          }}
        />
        <OpenButtons editor={editor} />
        {doc && rig && (
          <Text size="xs" c="dimmed">
            {file}: {doc.clip.frames} frames at {rig.fps} Hz, {rig.skeleton.names.length} joints
          </Text>
        )}
        <UnderstoodTable />
        <OwnRigInfo />
        {doc && <TroubleAlert isOfFile />}
        <OwnRigChoice editor={editor} />
        <ReadAs editor={editor} />
      </Stack>
    </Panel>
  );
}

/** How motion is carried between the user's own rig and the pack's body. */
function OwnRigInfo() {
  const own = useEditor((state) => state.own);
  if (!own) return null;
  const { there, certificate } = own;
  return (
    <Stack gap={4} role="group" aria-label="Own rig">
      <Text size="xs">
        On its own rig. Keyframes are carried to pack {own.pack.pack} at {there.scale.toFixed(2)} times the size, and
        its answers back. Your keyframes hold exactly.
      </Text>
      {certificate.faults.length > 0 && (
        <Alert color="yellow" variant="light" p="xs" title="Beyond the bar">
          <Faults certificate={certificate} />
        </Alert>
      )}
      <FiguresTable certificate={certificate} />
    </Stack>
  );
}

/** A file that is not opened on the pack's body, but could be on its own rig. */
function OwnRigChoice({ editor }: { editor: Editor }) {
  const { own, refused, reading, trouble, isBusy } = useEditor();
  if (own || !reading || (!refused && !trouble?.isOfFile)) return null;
  const button = (label: string) => (
    <Button
      size="compact-xs"
      variant="light"
      loading={isBusy}
      onClick={() => {
        void editor.openOnOwn();
      }}
    >
      {label}
    </Button>
  );
  if (!refused) return button('Open it on its own rig');
  return (
    <>
      <Alert color="red" variant="light" p="xs" title={`${refused.file} is beyond the bar`}>
        <Faults certificate={refused.certificate} />
        {button('Use its rig anyway')}
      </Alert>
      <FiguresTable certificate={refused.certificate} />
    </>
  );
}

/** What was understood of the opened file. The evidence shows when the pointer rests on a row. */
function UnderstoodTable() {
  const rows = useEditor((state) => state.understood);
  if (rows.length === 0) return null;
  return (
    <Table fz="xs" verticalSpacing={2} aria-label="What was understood of the file">
      <Table.Tbody>
        {rows.map(([what, value, evidence], row) => (
          <Table.Tr key={row} title={evidence}>
            <Table.Td c="dimmed">{what}</Table.Td>
            <Table.Td>{what === 'repaired' || what === 'odd' ? evidence : value}</Table.Td>
          </Table.Tr>
        ))}
      </Table.Tbody>
    </Table>
  );
}

export function KeyframesPanel({ editor }: { editor: Editor }) {
  const [isOpen, setOpen] = useState(true);
  const doc = useEditor(docOf);
  const limits = useEditor((state) => state.rig?.limits);
  const frame = useEditor((state) => state.frame);
  if (!doc || !limits) return null;
  return (
    <Panel
      title="Keyframes"
      id="keyframes"
      isOpen={isOpen}
      onToggle={() => {
        setOpen(!isOpen);
      }}
    >
      <Stack gap={6}>
        {doc.targets.map((target, t) => {
          const at = targetFrame(doc, t);
          return (
            <div key={t} className="keyframe" data-here={frame === at}>
              <button
                type="button"
                aria-label={`Go to keyframe ${at}`}
                onClick={() => {
                  useEditor.setState({ isPlaying: false });
                  editor.setFrame(at);
                }}
              >
                {at}
                {target.edited ? ' · posed' : ''}
              </button>
              <Checkbox
                size="xs"
                label="root"
                checked={target.givesRoot}
                disabled={target.givesRoot && !target.givesPose}
                onChange={({ currentTarget }) => {
                  editor.changeTarget(t, { givesRoot: currentTarget.checked });
                }}
              />
              <Checkbox
                size="xs"
                label="pose"
                checked={target.givesPose}
                disabled={target.givesPose && !target.givesRoot}
                onChange={({ currentTarget }) => {
                  editor.changeTarget(t, { givesPose: currentTarget.checked });
                }}
              />
              <Icon
                label="As captured"
                isOff={!target.edited}
                onClick={() => {
                  editor.resetTarget(t);
                }}
              >
                <RotateCcw size={13} />
              </Icon>
              <Icon
                label="Remove"
                isOff={doc.targets.length === 1}
                onClick={() => {
                  editor.removeTarget(t);
                }}
              >
                <Minus size={13} />
              </Icon>
            </div>
          );
        })}
        <Button
          size="compact-xs"
          variant="subtle"
          leftSection={<Plus size={13} />}
          disabled={doc.targets.length >= limits.maxTargets}
          onClick={() => {
            editor.addTarget();
          }}
        >
          Add a keyframe, {doc.targets.length} of {limits.maxTargets}
        </Button>
        <Posing editor={editor} />
      </Stack>
    </Panel>
  );
}

function Icon({
  label,
  isOff,
  onClick,
  children,
}: {
  label: string;
  isOff: boolean;
  onClick: () => void;
  children: React.ReactNode;
}) {
  return (
    <Tooltip label={label}>
      <ActionIcon size="sm" variant="subtle" color="gray" aria-label={label} disabled={isOff} onClick={onClick}>
        {children}
      </ActionIcon>
    </Tooltip>
  );
}

/** What the handles of the keyframe under the playhead do. */
function Posing({ editor }: { editor: Editor }) {
  const handle = useEditor((state) => state.handle);
  const turns = useEditor((state) => state.turns);
  useEditor((state) => state.frame);
  useEditor((state) => state.isPlaying);
  if (editor.posed === undefined) {
    return (
      <Text size="xs" c="dimmed">
        Go to a keyframe to pose it.
      </Text>
    );
  }
  return (
    <>
      <Select
        label="Handle"
        size="xs"
        clearable
        placeholder="drag one on the stage"
        data={[ROOT, ...editor.limbsNow().map(({ name }) => name)]}
        value={handle ?? null}
        onChange={(name) => {
          useEditor.setState({ handle: name ?? undefined });
        }}
      />
      {handle === ROOT && (
        <SegmentedControl
          size="xs"
          aria-label="What the root's handle does"
          data={[
            { value: 'move', label: 'Move' },
            { value: 'turn', label: 'Turn' },
          ]}
          value={turns ? 'turn' : 'move'}
          onChange={(value) => {
            useEditor.setState({ turns: value === 'turn' });
          }}
        />
      )}
    </>
  );
}
