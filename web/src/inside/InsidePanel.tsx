// Look inside: the plan of the selected character, and its clock.
import { ActionIcon, Group, Progress, SegmentedControl, Stack, Text, Tooltip } from '@mantine/core';
import { Pause, Play, StepForward } from 'lucide-react';
import type { ReactNode } from 'react';
import { useEffect, useState } from 'react';
import { Panel, Row } from '../app/Panel';
import type { Character } from '../live/character';
import type { Live } from '../live/live';
import { report, useLive } from '../live/store';
import { tintCss } from '../app/theme';
import type { PeekResponse, PlanView } from '../wire/types';
import { clearPlan, drawContacts, drawPlan, STAGES } from './overlays';

/** Time between looks, ms. */
const EVERY_MS = 200;

/** What the server says of a character, five times a second, drawn on the stage. */
function usePeek(live: Live, of: Character | undefined): PeekResponse | undefined {
  const [peek, setPeek] = useState<{ of: string; answer: PeekResponse }>();
  useEffect(() => {
    if (!of) return undefined;
    let isOver = false;
    let failed = false;
    let isAsking = false;
    const look = async () => {
      if (isAsking || useLive.getState().connection !== 'live') return;
      isAsking = true;
      try {
        const answer = await live.api.peek(of.session);
        if (isOver) return;
        setPeek({ of: of.id, answer });
        drawPlan(live.stage, of, answer);
        failed = false;
      } catch (error) {
        // Said once: the banner shows a server that is away, and a lost session is opened again.
        if (!failed && useLive.getState().connection === 'live') report(error);
        failed = true;
      } finally {
        isAsking = false;
      }
    };
    void look();
    const timer = setInterval(() => void look(), EVERY_MS);
    let frame = requestAnimationFrame(function draw() {
      drawContacts(live.stage, of);
      frame = requestAnimationFrame(draw);
    });
    return () => {
      isOver = true;
      clearInterval(timer);
      cancelAnimationFrame(frame);
      clearPlan(live.stage, of);
    };
  }, [live, of]);
  return peek && peek.of === of?.id ? peek.answer : undefined;
}

export function InsidePanel({ live }: { live: Live }) {
  const selected = useLive((state) => state.selected);
  const isOpen = useLive((state) => state.inside);
  return (
    <Panel
      title="Look inside"
      id="inside"
      isOpen={isOpen}
      onToggle={() => {
        useLive.setState({ inside: !isOpen });
      }}
    >
      <Inside live={live} of={live.crowd.all.get(selected ?? '')} />
    </Panel>
  );
}

function Inside({ live, of }: { live: Live; of: Character | undefined }) {
  const peek = usePeek(live, of);
  if (!of) return <Text c="dimmed">Click a character, or press Tab, to choose one.</Text>;
  const session = peek?.session;
  const plan = peek?.plan;
  return (
    <Stack gap="sm">
      <Text size="sm" c="dimmed">
        {of.kind.key}, {session?.style ?? of.role.style}
        {of === live.own ? ' · yours' : ''}
      </Text>
      <Time live={live} />
      <Lead peek={peek} />
      {session && plan && <Plan plan={plan} frame={Number(session.frame)} isInFlight={peek.in_flight} />}
      {plan && plan.gaits.length > 0 && <Gaits plan={plan} />}
      {plan && plan.tokens.length > 0 && <TokenGrid tokens={plan.tokens} codes={of.kind.codes} heads={of.kind.heads} />}
      <Legend plan={plan ?? undefined} />
    </Stack>
  );
}

function Time({ live }: { live: Live }) {
  const { paused, speed } = useLive((state) => state.time);
  return (
    <Group gap="xs" wrap="nowrap">
      <Tooltip label={paused ? 'Go on (Space)' : 'Pause (Space)'}>
        <ActionIcon
          variant={paused ? 'filled' : 'default'}
          aria-label={paused ? 'Go on' : 'Pause'}
          onClick={() => {
            live.setTime(!paused, speed);
          }}
        >
          {paused ? <Play size={16} /> : <Pause size={16} />}
        </ActionIcon>
      </Tooltip>
      <Tooltip label="One frame (.)">
        <ActionIcon
          variant="default"
          aria-label="One frame"
          onClick={() => {
            live.step();
          }}
        >
          <StepForward size={16} />
        </ActionIcon>
      </Tooltip>
      <SegmentedControl
        size="xs"
        fullWidth
        style={{ flex: 1 }}
        aria-label="Speed of time"
        value={String(speed)}
        data={[
          { value: '0.1', label: '⅒' },
          { value: '0.25', label: '¼' },
          { value: '0.5', label: '½' },
          { value: '1', label: '1×' },
        ]}
        onChange={(value) => {
          live.setTime(paused, Number(value));
        }}
      />
    </Group>
  );
}

function Lead({ peek }: { peek: PeekResponse | undefined }) {
  const frames = peek?.session?.buffered_frames ?? 0;
  return (
    <div>
      <Row label="Buffered" value={`${frames} frames, ${(frames / 30).toFixed(2)} s`} />
      <Progress
        mt={4}
        size="sm"
        value={Math.min(100, (frames / 54) * 100)}
        transitionDuration={0}
        aria-label="Frames planned beyond the cursor"
      />
    </div>
  );
}

function Plan({ plan, frame, isInFlight }: { plan: PlanView; frame: number; isInFlight: boolean }) {
  const age = Math.max(0, frame - Number(plan.asked_at_frame));
  return (
    <div>
      <Row label="Plan" value={`№ ${plan.number}, ${plan.cause.replace('_', ' ')}`} />
      <Row label="Age" value={`${age} frames, ${((age / 30) * 1000).toFixed(0)} ms`} />
      <Row label="Next plan" value={isInFlight ? 'on its way' : 'not requested'} />
    </div>
  );
}

function Gaits({ plan }: { plan: PlanView }) {
  const gaits = [...plan.gaits].sort((a, b) => b.weight - a.weight).slice(0, 4);
  return (
    <div>
      <Text size="xs" c="dimmed" mb={2}>
        Gaits
      </Text>
      {gaits.map(({ gait, weight }) => (
        <Row key={gait} label={gait} value={`${(weight * 100).toFixed(0)} %`} />
      ))}
    </div>
  );
}

/** The ramp of the project's pictures. */
const RAMP = [
  [0x1b, 0x6f, 0xd8],
  [0x7a, 0x4d, 0xd8],
  [0xd8, 0x43, 0x8c],
] as const;

function ramp(t: number): string {
  const at = Math.min(1.999, Math.max(0, t * 2));
  const [a, b] = [RAMP[Math.floor(at)]!, RAMP[Math.floor(at) + 1]!];
  const rgb = a.map((v, i) => Math.round(v + (b[i]! - v) * (at % 1)));
  return `rgb(${rgb.join(' ')})`;
}

/** Motion tokens as colours: a column a token, a row a head. */
export function TokenGrid({ tokens, codes, heads }: { tokens: readonly number[]; codes: number; heads: number }) {
  const columns = Math.max(1, Math.floor(tokens.length / Math.max(1, heads)));
  return (
    <div>
      <Text size="xs" c="dimmed" mb={4}>
        Tokens: {columns} of four frames, {heads} heads each
      </Text>
      <div className="tokens" style={{ gridTemplateColumns: `repeat(${columns}, 1fr)` }}>
        {Array.from({ length: heads * columns }, (_, i) => {
          const code = tokens[(i % columns) * heads + Math.floor(i / columns)] ?? 0;
          return <span key={i} title={`code ${code}`} style={{ background: ramp(code / Math.max(1, codes - 1)) }} />;
        })}
      </div>
    </div>
  );
}

/** Which line is which, and what the discs are. */
export function StageLegend({
  stages,
  children,
}: {
  stages: readonly (typeof STAGES)[number][];
  children?: ReactNode;
}) {
  return (
    <div className="legend">
      {stages.map(({ name, says, tint }) => (
        <div key={name}>
          <i style={{ background: tintCss(tint) }} />
          <code>{name}</code>
          <span>{says}</span>
        </div>
      ))}
      <div>
        <i className="disc" style={{ background: tintCss(3) }} />
        <span>feet that stand</span>
      </div>
      {children}
    </div>
  );
}

function Legend({ plan }: { plan: PlanView | undefined }) {
  const isDrawn = [
    plan?.root_r_g1 != null,
    (plan?.root_r_g2.length ?? 0) > 0,
    (plan?.root_r_g3.length ?? 0) > 0,
    (plan?.root_r_g4.length ?? 0) > 0,
  ];
  return (
    <StageLegend stages={STAGES.filter((_, i) => isDrawn[i])}>
      {(plan?.targets.length ?? 0) > 0 && (
        <div>
          <i className="ghost" />
          <span>keyframes of the plan</span>
        </div>
      )}
    </StageLegend>
  );
}
