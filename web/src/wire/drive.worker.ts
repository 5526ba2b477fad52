/// <reference lib="webworker" />
// Owns the WebSocket of a stream: reads its protobuf messages, decodes frames, and hands them to
// the page.
import { create, fromBinary, fromJson, toBinary, toJson } from '@bufbuild/protobuf';
import type { JsonValue, Message } from '@bufbuild/protobuf';
import type { GenMessage } from '@bufbuild/protobuf/codegenv2';
import { decodeBlock } from './codec';
import type { DriveFrames, DriveRequest } from './gen/troupe/v1/session_pb';
import {
  CommandSchema,
  CommandRequestSchema,
  CommandResponseSchema,
  DriveAttachSchema,
  DriveAttachedSchema,
  DriveDetachSchema,
  DriveEventsSchema,
  DriveLeftSchema,
  DriveOpenSchema,
  DriveRequestSchema,
  DriveResponseSchema,
  Encoding,
  ProblemSchema,
} from './gen/troupe/v1/session_pb';
import type { Command } from './types';
import type { FromWorker, TickMessage, ToWorker } from './messages';

const scope = self as unknown as DedicatedWorkerGlobalScope;
let socket: WebSocket | undefined;

function say(message: FromWorker, transfer: Transferable[] = []): void {
  scope.postMessage(message, transfer);
}

function ask(message: DriveRequest['message']): void {
  if (socket?.readyState !== WebSocket.OPEN) return;
  socket.send(toBinary(DriveRequestSchema, create(DriveRequestSchema, { message })));
}

/** A message as JSON, as it comes over HTTP. */
function plain<T extends Message>(schema: GenMessage<T>, message: T): unknown {
  return toJson(schema, message, { useProtoFieldName: true, alwaysEmitImplicit: true });
}

function commandOf(command: Command) {
  return fromJson(CommandSchema, JSON.parse(JSON.stringify(command)) as JsonValue);
}

function tickOf(frames: DriveFrames, bytes: number, started: number): TickMessage {
  const blocks = frames.blocks.map((block) =>
    decodeBlock({
      pack: block.pack,
      body: block.body,
      slots: block.slots,
      frames: block.firstFrames.map(Number),
      roots: block.packedRoots,
      rotations: block.packedRotations,
      contacts: block.contacts,
    }),
  );
  return {
    kind: 'tick',
    tick: Number(frames.tick),
    dropped_ticks: Number(frames.droppedTicks),
    underruns: frames.underruns,
    blocks,
    held: frames.held.map(({ slot, instance, position: p, rotation: r }) => ({
      slot,
      instance,
      position: [p?.x ?? 0, p?.y ?? 0, p?.z ?? 0],
      rotation: [r?.x ?? 0, r?.y ?? 0, r?.z ?? 0, r?.w ?? 1],
    })),
    bytes,
    decode_ms: performance.now() - started,
  };
}

function hear(data: ArrayBuffer): void {
  const started = performance.now();
  const { message } = fromBinary(DriveResponseSchema, new Uint8Array(data));
  switch (message.case) {
    case 'frames': {
      const tick = tickOf(message.value, data.byteLength, started);
      const arrays = tick.blocks.flatMap((b) => [b.slots, b.frames, b.roots, b.rotations, b.contacts]);
      say(
        tick,
        arrays.map((array) => array.buffer as ArrayBuffer),
      );
      break;
    }
    case 'attached':
      say({ kind: 'attached', ...(plain(DriveAttachedSchema, message.value) as object) } as FromWorker);
      break;
    case 'left':
      say({ kind: 'left', ...(plain(DriveLeftSchema, message.value) as object) } as FromWorker);
      break;
    case 'commands':
      say({ kind: 'refused', ...(plain(CommandResponseSchema, message.value) as object) } as FromWorker);
      break;
    case 'events':
      say({ kind: 'events', ...(plain(DriveEventsSchema, message.value) as object) } as FromWorker);
      break;
    case 'closing':
      if (message.value.reason)
        say({ kind: 'closing', reason: plain(ProblemSchema, message.value.reason) } as FromWorker);
      break;
    case undefined:
      break;
  }
}

function open(url: string, rateHz: number): void {
  close();
  const opened = new WebSocket(url);
  opened.binaryType = 'arraybuffer';
  opened.onopen = () => {
    ask({ case: 'open', value: create(DriveOpenSchema, { rateHz, encoding: Encoding.COMPACT }) });
    say({ kind: 'opened' });
  };
  opened.onmessage = (event: MessageEvent<ArrayBuffer | string>) => {
    if (socket === opened && typeof event.data !== 'string') hear(event.data);
  };
  opened.onclose = (event) => {
    if (socket !== opened) return;
    socket = undefined;
    say({ kind: 'closed', code: event.code, reason: event.reason });
  };
  socket = opened;
}

function close(): void {
  const old = socket;
  socket = undefined;
  old?.close();
}

scope.onmessage = ({ data }: MessageEvent<ToWorker>) => {
  switch (data.kind) {
    case 'open':
      open(data.url, data.rate_hz);
      break;
    case 'attach':
      ask({ case: 'attach', value: create(DriveAttachSchema, { sessionIds: data.ids }) });
      break;
    case 'detach':
      ask({ case: 'detach', value: create(DriveDetachSchema, { sessionIds: data.ids }) });
      break;
    case 'commands':
      ask({ case: 'command', value: create(CommandRequestSchema, { commands: data.commands.map(commandOf) }) });
      break;
    case 'close':
      close();
  }
};
