/**
 * A stream of a meshtide server over a websocket (docs/format.md, 13), as the bytes of its .tide file: packets come in
 * their order, so that whoever reads them need not know how they came.
 */
import { type AttemptOptions, attempts, Interruption } from "./attempts.js";
import { crc32 } from "./crc32.js";
import { errorOf, type MeshtideError } from "./errors.js";
import { LIMITS } from "./limits.js";
import { Double, pack, unpack, type Value } from "./msgpack.js";
import type { Until } from "./until.js";

export interface WebsocketOptions extends AttemptOptions {
  readonly until: Until;
}

const PROTOCOL = 1;
const WINDOW = 1 << 20; // bytes that the server may send ahead
const MESSAGE = { hello: 0, credit: 1, headerPart: 2, packetPart: 3, done: 4, error: 5 };
const MAGIC = [0x89, 0x54, 0x49, 0x44, 0x45, 0x0d, 0x0a, 0x1a];
/** Refusals after which another connection may succeed. */
const PASSING = ["not-ready", "timeout", "shutting-down", "internal"];

interface Progress {
  fingerprint: Uint8Array;
  /** Whether the header has been given on. */
  opened: boolean;
  /** The packet that came last, and how much of it. */
  packet: number;
  offset: number;
}

/** url: of a mesh, http(s)://host/meshes/ID. */
export function websocket(url: string, options: WebsocketOptions): AsyncGenerator<Uint8Array> {
  const progress = { fingerprint: new Uint8Array(), opened: false, packet: 0, offset: 0 };
  return attempts(() => connection(url, options, progress), options);
}

async function* connection(url: string, options: WebsocketOptions, progress: Progress): AsyncGenerator<Uint8Array> {
  const address = new URL(url);
  const mesh = decodeURIComponent(address.pathname.replace(/^.*?\/meshes\//, ""));
  address.protocol = address.protocol.replace("http", "ws");
  address.pathname += "/stream";
  const frames = new Frames(address, options.signal);
  try {
    await frames.opened();
    const { level = null, error, bytes = null } = options.until;
    const bound = error === undefined ? null : new Double(error);
    const held = progress.packet > 0 ? [[0, progress.packet]] : [];
    frames.send(pack([MESSAGE.hello, PROTOCOL, mesh, progress.fingerprint, held, level, bound, bytes, WINDOW]));
    yield* received(frames, progress);
  } finally {
    frames.close();
  }
}

async function* received(frames: Frames, progress: Progress): AsyncGenerator<Uint8Array> {
  const header: Uint8Array[] = [];
  let owed = 0; // bytes that came and were not granted again
  let repeated = progress.offset; // of the packet that was cut, bytes that come once more
  let [packet, offset] = [progress.packet, 0];
  for (;;) {
    const message = unpack(await frames.next());
    const [type, ...fields] = Array.isArray(message) ? (message as readonly Value[]) : [];
    if (type === MESSAGE.done) return;
    if (type === MESSAGE.error) throw refusal(String(fields[0]), String(fields[1]));
    const data = fields.at(-1);
    if (!(data instanceof Uint8Array)) throw breach("a part without data");
    if (type === MESSAGE.headerPart) {
      const bytes = headerPart(fields, header, progress);
      if (bytes !== null) yield bytes;
    } else if (type === MESSAGE.packetPart) {
      if (!progress.opened) throw breach("a packet before the header");
      const [index, start] = fields;
      if (index === packet + 1 && start === 0) {
        if (repeated > 0) throw breach("less of a packet than before");
        [packet, offset] = [packet + 1, 0];
      }
      if (index !== packet || start !== offset) throw breach("a packet that is not the next one");
      offset += data.length;
      const fresh = data.subarray(Math.min(repeated, data.length));
      repeated -= data.length - fresh.length;
      if (repeated === 0) [progress.packet, progress.offset] = [packet, offset];
      if (fresh.length > 0) yield fresh;
    } else throw breach("an unknown message");
    owed += data.length;
    if (owed >= WINDOW / 2) {
      frames.send(pack([MESSAGE.credit, owed]));
      owed = 0;
    }
  }
}

/** What a file begins with, once the header is whole. */
function headerPart(fields: readonly Value[], parts: Uint8Array[], progress: Progress): Uint8Array | null {
  const [fingerprint, total, offset, data] = fields as [Value, Value, Value, Uint8Array];
  if (!(fingerprint instanceof Uint8Array) || typeof total !== "number" || total > LIMITS.headerBytes)
    throw breach("a header that is none");
  if (progress.opened) {
    const same = fingerprint.length === progress.fingerprint.length;
    if (!same || fingerprint.some((byte, i) => byte !== progress.fingerprint[i]))
      throw errorOf("changed", "the mesh has changed on the server while it was loaded; load it again");
    return null;
  }
  const size = parts.reduce((sum, part) => sum + part.length, 0);
  if (offset !== size || size + data.length > total) throw breach("parts of the header that do not fit");
  parts.push(data);
  if (size + data.length < total) return null;
  progress.fingerprint = fingerprint.slice();
  progress.opened = true;
  return fileHeader(parts, total);
}

function fileHeader(parts: readonly Uint8Array[], length: number): Uint8Array {
  const bytes = new Uint8Array(18 + length);
  const view = new DataView(bytes.buffer);
  bytes.set(MAGIC);
  view.setUint16(8, parts[0]?.[0] ?? 0, true); // a header begins with the version, too
  view.setUint32(10, length, true);
  view.setUint32(14, crc32(...parts), true);
  let at = 18;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}

function breach(what: string): MeshtideError {
  return errorOf("protocol", `the server does not keep to the protocol: it sends ${what}`);
}

function refusal(code: string, message: string): MeshtideError | Interruption {
  const error = errorOf("refused", `the server refuses: ${message} (${code})`);
  return PASSING.includes(code) ? new Interruption(error) : error;
}

/** The binary frames of a websocket, waited for one by one; what waits is bounded by the credit. */
class Frames {
  readonly #socket: WebSocket;
  readonly #waiting: Uint8Array[] = [];
  #bytes = 0;
  #end: Error | undefined;
  #wake: () => void = () => undefined;
  readonly #stop: () => void;

  constructor(
    address: URL,
    private readonly signal: AbortSignal,
  ) {
    if (signal.aborted) throw errorOf("aborted", "loading was aborted");
    this.#socket = new WebSocket(address);
    this.#socket.binaryType = "arraybuffer";
    this.#stop = () => this.#finish(errorOf("aborted", "loading was aborted"));
    signal.addEventListener("abort", this.#stop, { once: true });
    this.#socket.onopen = () => this.#wake();
    this.#socket.onmessage = ({ data }) => {
      if (typeof data === "string") return this.#finish(breach("text"));
      this.#bytes += (data as ArrayBuffer).byteLength;
      if (this.#bytes > 2 * WINDOW) return this.#finish(breach("more than it was allowed"));
      this.#waiting.push(new Uint8Array(data as ArrayBuffer));
      this.#wake();
    };
    this.#socket.onclose = ({ code }) => {
      const lost = `the connection to ${address.host} was lost (${code})`;
      this.#finish(new Interruption(errorOf("network", lost)));
    };
    this.#socket.onerror = () => undefined; // a close follows
  }

  async opened(): Promise<void> {
    while (this.#socket.readyState === 0 && this.#end === undefined) await this.#news();
    if (this.#end !== undefined) throw this.#end;
  }

  async next(): Promise<Uint8Array> {
    while (this.#waiting.length === 0) {
      if (this.#end !== undefined) throw this.#end;
      await this.#news();
    }
    const frame = this.#waiting.shift() as Uint8Array;
    this.#bytes -= frame.length;
    return frame;
  }

  send(frame: Uint8Array): void {
    if (this.#socket.readyState === 1) this.#socket.send(frame as Uint8Array<ArrayBuffer>);
  }

  close(): void {
    this.signal.removeEventListener("abort", this.#stop);
    this.#socket.close();
  }

  #news(): Promise<void> {
    return new Promise((resolve) => {
      this.#wake = resolve;
    });
  }

  #finish(error: Error): void {
    this.#end ??= error;
    this.#wake();
  }
}
