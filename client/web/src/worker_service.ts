/** What the worker does: decodings of any number of streams, asked for by messages through a port. */
import type { Files, Header } from "./core.js";
import { Decoding, type Level } from "./decoding.js";
import { type PlainError, plainError } from "./errors.js";
import type { Limits } from "./limits.js";
import type { Until } from "./until.js";

export type Request =
  | { readonly do: "open"; readonly stream: number; readonly limits: Partial<Limits>; readonly until: Until }
  | { readonly do: "push"; readonly stream: number; readonly call: number; readonly bytes: Uint8Array }
  | { readonly do: "end"; readonly stream: number; readonly call: number }
  | { readonly do: "close"; readonly stream: number };

export interface Pushed {
  readonly level: Level | null;
  /** Of the stream, with the first answer after it is known. */
  readonly header: Header | null;
  readonly complete: boolean;
  /** Of the file up to the last packet that is due; 0 before the header is there. */
  readonly dueBytes: number;
}

export interface Answer {
  readonly call: number;
  readonly pushed?: Pushed;
  readonly error?: PlainError;
}

/** A worker's global scope, or one end of a MessageChannel. */
export interface Port {
  onmessage: ((event: MessageEvent) => void) | null;
  postMessage(message: unknown, transfer: Transferable[]): void;
}

interface Stream {
  readonly decoding: Decoding;
  /** Ends when all calls so far have been answered. */
  busy: Promise<void>;
  headerTold: boolean;
}

/** Answers the requests that come through a port. */
export function serve(port: Port, files: Files): void {
  const streams = new Map<number, Stream>();
  port.onmessage = ({ data }: MessageEvent<Request>) => {
    if (data.do === "open") {
      const decoding = new Decoding(files, data.limits, data.until);
      streams.set(data.stream, { decoding, busy: Promise.resolve(), headerTold: false });
      return;
    }
    if (data.do === "close") {
      streams.delete(data.stream);
      return;
    }
    const stream = streams.get(data.stream);
    if (stream === undefined) return; // closed meanwhile: nobody waits for the answer
    stream.busy = stream.busy.then(async () => {
      if (streams.get(data.stream) !== stream) return;
      const [answer, transfer] = await answered(stream, data);
      port.postMessage(answer, transfer);
    });
  };
}

async function answered(
  stream: Stream,
  request: Extract<Request, { call: number }>,
): Promise<[Answer, Transferable[]]> {
  const { decoding } = stream;
  const { call } = request;
  try {
    let level: Level | null = null;
    if (request.do === "push") level = await decoding.push(request.bytes);
    else decoding.end();
    const header = stream.headerTold ? null : (decoding.header ?? null);
    stream.headerTold ||= header !== null;
    const transfer = level === null ? [] : [level.positions.buffer, level.normals.buffer, level.indices.buffer];
    return [
      { call, pushed: { level, header, complete: decoding.complete, dueBytes: decoding.dueBytes } },
      transfer as ArrayBuffer[],
    ];
  } catch (error) {
    return [{ call, error: plainError(error) }, []];
  }
}
