/**
 * Every error that this package raises on purpose.
 *
 *     MeshtideError
 *     ├── StreamError      bytes that are damaged, or no meshtide stream      not-a-stream, version, damaged, malformed
 *     │   ├── LimitError   the stream claims more than the limits allow       limit
 *     │   └── CutError     the stream ends early; what came before is usable  cut
 *     ├── TransferError    the network or the server failed                   http, network, protocol, refused, changed
 *     └── RuntimeError     it cannot go on in this page                       memory, wasm, internal, disposed, aborted
 */

export type ErrorCode =
  | "not-a-stream"
  | "version"
  | "damaged"
  | "malformed"
  | "limit"
  | "cut"
  | "http"
  | "network"
  | "protocol"
  | "refused"
  | "changed"
  | "aborted"
  | "memory"
  | "wasm"
  | "internal"
  | "disposed";

/** Where in a stream an error was found, as far as that is known. */
export interface Place {
  /** Name of the kind of packet. */
  readonly kind?: string;
  readonly level?: number;
  readonly slice?: number;
  /** Byte of the file. */
  readonly offset?: number;
  /** Of an HTTP answer. */
  readonly status?: number;
}

export class MeshtideError extends Error {
  override readonly name: string = "MeshtideError";
  constructor(
    readonly code: ErrorCode,
    /** What was wrong, without the place. */
    readonly reason: string,
    readonly place: Place = {},
  ) {
    super(describe(reason, place));
  }
}

export class StreamError extends MeshtideError {
  override readonly name: string = "StreamError";
}
export class LimitError extends StreamError {
  override readonly name = "LimitError";
}
export class CutError extends StreamError {
  override readonly name = "CutError";
}
export class TransferError extends MeshtideError {
  override readonly name = "TransferError";
}
export class RuntimeError extends MeshtideError {
  override readonly name = "RuntimeError";
}

type Constructor = new (code: ErrorCode, reason: string, place?: Place) => MeshtideError;
const CLASSES: Record<ErrorCode, Constructor> = {
  "not-a-stream": StreamError,
  version: StreamError,
  damaged: StreamError,
  malformed: StreamError,
  limit: LimitError,
  cut: CutError,
  http: TransferError,
  network: TransferError,
  protocol: TransferError,
  refused: TransferError,
  changed: TransferError,
  aborted: RuntimeError,
  memory: RuntimeError,
  wasm: RuntimeError,
  internal: RuntimeError,
  disposed: RuntimeError,
};

/** An error of the class that its code belongs to. */
export function errorOf(code: ErrorCode, reason: string, place: Place = {}): MeshtideError {
  return new CLASSES[code](code, reason, place);
}

/** An error as it crosses from the worker to the page. */
export interface PlainError {
  readonly code: ErrorCode;
  readonly reason: string;
  readonly place: Place;
}

export function plainError(error: unknown): PlainError {
  if (error instanceof MeshtideError) return { code: error.code, reason: error.reason, place: error.place };
  return { code: "internal", reason: error instanceof Error ? error.message : String(error), place: {} };
}

function describe(reason: string, { kind, level, slice, offset }: Place): string {
  const parts = [];
  if (level !== undefined) parts.push(`level ${level}`);
  if (kind !== undefined) parts.push(`${kind} packet`);
  if (slice) parts.push(`slice ${slice}`);
  if (offset !== undefined) parts.push(`byte ${offset}`);
  return parts.length === 0 ? reason : `${parts.join(", ")}: ${reason}`;
}
