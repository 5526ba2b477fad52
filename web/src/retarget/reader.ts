// The reader and the retargeter of the server and the command line (bindings/web), as WebAssembly.
// It is loaded when it is first wanted. `scripts/web.sh reader` builds it into src/reader.
import wasm from '../reader/troupe_reader_web_bg.wasm?url';

export type Reader = typeof import('../reader/troupe_reader_web');

let loading: Promise<Reader> | undefined;
let memory: WebAssembly.Memory | undefined;

/** The reader, from its address or its bytes. A failed try does not stay. */
export function loadReader(source: string | BufferSource = wasm): Promise<Reader> {
  loading ??= import('../reader/troupe_reader_web')
    .then(async (reader) => {
      ({ memory } = await reader.default({ module_or_path: source }));
      return reader;
    })
    .catch((error: unknown) => {
      loading = undefined;
      throw error;
    });
  return loading;
}

/** The memory of the reader, once it is loaded. Its buffer is another one after it has grown. */
export function readerMemory(): WebAssembly.Memory {
  if (!memory) throw new Error('the reader is not loaded');
  return memory;
}
