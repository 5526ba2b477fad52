// Numbers of the server and of the page, once a second.
import { Stack, Text } from '@mantine/core';
import { useEffect, useState } from 'react';
import { Panel } from '../app/Panel';
import type { Live } from '../live/live';
import { useLive } from '../live/store';
import { ApiError } from '../wire/api';
import { Sparkline } from './Sparkline';
import { mean, quantile, rate, Snapshot } from './prometheus';

const EVERY_MS = 1000;
/** Moments that a line shows. */
const KEPT = 60;
/** Moments between the two that rates and quantiles compare. */
const WINDOW = 5;

const NOT_ALLOWED =
  "This key may not read the server's numbers: that takes a key of the role metrics or admin. Below are the numbers of this page.";

interface Reading {
  label: string;
  /** `undefined`: nothing happened that could be measured. */
  value: number | undefined;
  unit: string;
  digits: number;
  hint?: string;
}

interface Group {
  title: string;
  readings: Reading[];
}

function ofServer(before: Snapshot, now: Snapshot): Group {
  const ms = (share: number) => {
    const seconds = quantile(before, now, 'troupe_queue_duration_seconds', share, { class: 'plan' });
    return seconds === undefined ? undefined : seconds * 1000;
  };
  const request = (share: number) => {
    const seconds = quantile(before, now, 'troupe_request_duration_seconds', share);
    return seconds === undefined ? undefined : seconds * 1000;
  };
  return {
    title: 'Server',
    readings: [
      { label: 'Frames', value: rate(before, now, 'troupe_frames_sent_total'), unit: '/s', digits: 0 },
      { label: 'Plans', value: rate(before, now, 'troupe_replans_total'), unit: '/s', digits: 0 },
      { label: 'Plan waits, p50', value: ms(0.5), unit: 'ms', digits: 1, hint: 'in the queue, before its batch' },
      { label: 'Plan waits, p99', value: ms(0.99), unit: 'ms', digits: 1, hint: 'in the queue, before its batch' },
      { label: 'Calls, p50', value: request(0.5), unit: 'ms', digits: 1 },
      { label: 'Calls, p99', value: request(0.99), unit: 'ms', digits: 1 },
      { label: 'Batch', value: mean(before, now, 'troupe_batch_size'), unit: '', digits: 1, hint: 'characters' },
      { label: 'Queue', value: now.sum('troupe_pending_characters'), unit: '', digits: 0, hint: 'characters' },
      { label: 'Underruns', value: rate(before, now, 'troupe_underruns_total'), unit: '/s', digits: 1 },
      { label: 'Sessions', value: now.sum('troupe_sessions_active'), unit: '', digits: 0 },
      { label: 'Pressure', value: now.max('troupe_crowd_pressure'), unit: '', digits: 2 },
      { label: 'CPU', value: rate(before, now, 'process_cpu_seconds_total'), unit: 'cores', digits: 2 },
    ],
  };
}

function ofPage({ meters }: Live): Group {
  return {
    title: 'This page',
    readings: [
      { label: 'Stream', value: meters.bytes.perSecond(performance.now()) / 1000, unit: 'kB/s', digits: 1 },
      {
        label: 'Decode, p50',
        value: meters.decode_ms.quantile(0.5),
        unit: 'ms',
        digits: 2,
        hint: 'a tick, in the worker',
      },
      { label: 'Frame, p50', value: meters.frame_ms.quantile(0.5), unit: 'ms', digits: 1, hint: 'of the main thread' },
      { label: 'Frame, p99', value: meters.frame_ms.quantile(0.99), unit: 'ms', digits: 1, hint: 'of the main thread' },
    ],
  };
}

type History = Record<string, (number | undefined)[]>;

function useNumbers(live: Live): { groups: Group[]; history: History; trouble: string } {
  const [state, setState] = useState<{ groups: Group[]; history: History; trouble: string }>({
    groups: [],
    history: {},
    trouble: '',
  });
  useEffect(() => {
    const moments: Snapshot[] = [];
    let mayRead = true;
    const read = async (groups: Group[]): Promise<string> => {
      if (!mayRead) return NOT_ALLOWED;
      try {
        moments.push(new Snapshot(await live.api.metrics(), performance.now()));
        if (moments.length > WINDOW + 1) moments.shift();
        if (moments.length > 1) groups.push(ofServer(moments[0]!, moments.at(-1)!));
        return '';
      } catch (error) {
        moments.length = 0;
        // The key stays the same, so there is no use in asking again.
        mayRead = !(error instanceof ApiError && error.status === 403);
        if (!mayRead) return NOT_ALLOWED;
        const why = error instanceof Error ? error.message : String(error);
        return `The server's numbers cannot be read: ${why}`;
      }
    };
    const look = async () => {
      const groups: Group[] = [];
      const trouble = await read(groups);
      groups.push(ofPage(live));
      setState(({ history }) => {
        const next: History = {};
        for (const { title, readings } of groups) {
          for (const { label, value } of readings) {
            const key = `${title}/${label}`;
            next[key] = [...(history[key] ?? []), value].slice(-KEPT);
          }
        }
        return { groups, history: next, trouble };
      });
    };
    void look();
    const timer = setInterval(() => void look(), EVERY_MS);
    return () => {
      clearInterval(timer);
    };
  }, [live]);
  return state;
}

export function NumbersPanel({ live }: { live: Live }) {
  const isOpen = useLive((state) => state.numbers);
  return (
    <Panel
      title="Numbers"
      id="numbers"
      isOpen={isOpen}
      onToggle={() => {
        useLive.setState({ numbers: !isOpen });
      }}
    >
      <Numbers live={live} />
    </Panel>
  );
}

function Numbers({ live }: { live: Live }) {
  const { groups, history, trouble } = useNumbers(live);
  return (
    <Stack gap="md">
      {trouble && (
        <Text size="sm" c="dimmed">
          {trouble}
        </Text>
      )}
      {groups.map(({ title, readings }) => (
        <div key={title}>
          <Text size="xs" c="dimmed" mb={4}>
            {title}
          </Text>
          {readings.map(({ label, value, unit, digits, hint }) => (
            <div key={label} className="number" title={hint}>
              <span>{label}</span>
              <Sparkline values={history[`${title}/${label}`] ?? []} />
              <b>
                {value === undefined
                  ? '–'
                  : `${value.toFixed(digits)}${unit && (unit.startsWith('/') ? unit : ` ${unit}`)}`}
              </b>
            </div>
          ))}
        </div>
      ))}
    </Stack>
  );
}
