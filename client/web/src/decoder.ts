/**
 * Decodes a stream in a worker: push its bytes as they come, get levels.
 *
 *     const decoder = new Decoder();
 *     for (const bytes of pieces) {
 *       const { level } = await decoder.push(bytes);
 *       if (level !== null) show(level);
 *     }
 *     await decoder.end();
 *     decoder.dispose();
 */
import { errorOf, type MeshtideError } from "./errors.js";
import type { Limits } from "./limits.js";
import type { Until } from "./until.js";
import type { Answer, Port, Pushed, Request } from "./worker_service.js";

export type { Header, Packet, State } from "./core.js";
export type { Level } from "./decoding.js";
export {
  CutError,
  type ErrorCode,
  LimitError,
  MeshtideError,
  type Place,
  RuntimeError,
  StreamError,
  TransferError,
} from "./errors.js";
export { LIMITS, type Limits } from "./limits.js";
export type { Until } from "./until.js";
export type { Port, Pushed } from "./worker_service.js";

export interface DecoderOptions {
  readonly limits?: Partial<Limits>;
  readonly until?: Until;
  /** Where to decode, instead of in the worker that all decoders of the page share. */
  readonly connection?: Connection;
}

/** The page's end of a worker, which any number of decoders may share. */
export class Connection {
  readonly #waiting = new Map<number, { resolve(pushed: Pushed): void; reject(error: MeshtideError): void }>();
  #broken: MeshtideError | undefined;
  #numbers = 0;

  constructor(private readonly port: Port) {
    port.onmessage = ({ data }: MessageEvent<Answer>) => {
      const call = this.#waiting.get(data.call);
      this.#waiting.delete(data.call);
      if (data.error !== undefined) call?.reject(errorOf(data.error.code, data.error.reason, data.error.place));
      else if (data.pushed !== undefined) call?.resolve(data.pushed);
    };
  }

  /** No answer will come any more: every call fails, now and later. */
  break(reason: string): void {
    this.#broken = errorOf("wasm", reason);
    for (const call of this.#waiting.values()) call.reject(this.#broken);
    this.#waiting.clear();
  }

  get broken(): boolean {
    return this.#broken !== undefined;
  }

  number(): number {
    return ++this.#numbers;
  }

  tell(request: Request): void {
    this.port.postMessage(request, []);
  }

  /** Sends a request; `give` takes what would reject the call if nobody waited for it any more. */
  ask(make: (call: number) => Request, transfer: Transferable[], give: (cancel: () => void) => void): Promise<Pushed> {
    return new Promise((resolve, reject) => {
      if (this.#broken !== undefined) {
        reject(this.#broken);
        return;
      }
      const call = this.number();
      this.#waiting.set(call, { resolve, reject });
      give(() => {
        if (this.#waiting.delete(call)) reject(errorOf("disposed", "the decoder was disposed of"));
      });
      this.port.postMessage(make(call), transfer);
    });
  }
}

let shared: Connection | undefined;

/** The connection to the worker that the page has one of. */
function sharedConnection(): Connection {
  if (shared === undefined || shared.broken) {
    const worker = new Worker(new URL("./worker.js", import.meta.url), { type: "module", name: "meshtide" });
    const connection = new Connection(worker as unknown as Port);
    worker.onerror = (event) => {
      connection.break(`the decoder's worker cannot run: ${event.message || "its file cannot be loaded"}`);
      worker.terminate();
    };
    shared = connection;
  }
  return shared;
}

export class Decoder {
  readonly #connection: Connection;
  readonly #stream: number;
  readonly #cancels = new Set<() => void>();
  #disposed = false;

  constructor({ limits = {}, until = {}, connection = sharedConnection() }: DecoderOptions = {}) {
    this.#connection = connection;
    this.#stream = connection.number();
    connection.tell({ do: "open", stream: this.#stream, limits, until });
  }

  /** Takes the next bytes of the file; their buffer is transferred where they fill it. */
  push(bytes: Uint8Array): Promise<Pushed> {
    const whole = bytes.byteLength === bytes.buffer.byteLength ? [bytes.buffer as ArrayBuffer] : [];
    return this.#ask((call) => ({ do: "push", stream: this.#stream, call, bytes }), whole);
  }

  /** To be called where the bytes end: fails with a CutError if that is too early. */
  async end(): Promise<void> {
    await this.#ask((call) => ({ do: "end", stream: this.#stream, call }), []);
  }

  /** Gives back its memory; calls that wait fail. */
  dispose(): void {
    if (this.#disposed) return;
    this.#disposed = true;
    for (const cancel of this.#cancels) cancel();
    this.#connection.tell({ do: "close", stream: this.#stream });
  }

  async #ask(make: (call: number) => Request, transfer: Transferable[]): Promise<Pushed> {
    if (this.#disposed) throw errorOf("disposed", "the decoder was disposed of");
    let cancel: (() => void) | undefined;
    try {
      return await this.#connection.ask(make, transfer, (given) => {
        cancel = given;
        this.#cancels.add(given);
      });
    } finally {
      if (cancel !== undefined) this.#cancels.delete(cancel);
    }
  }
}
