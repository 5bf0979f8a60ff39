/**
 * The compiled core (codec/core, meshtide.h), called as it stands in WebAssembly.
 *
 * A failure ends the instance: it traps, and mt_last_failure says why. Every later call throws the same error again.
 */
import { type ErrorCode, errorOf, type MeshtideError, type Place } from "./errors.js";
import { LIMITS, type Limits } from "./limits.js";

/** Gives the bytes of a file of the package: WebAssembly or trained states. */
export type Files = (name: string) => Promise<BufferSource>;

export interface Packet {
  readonly length: number;
  readonly checksum: number;
  readonly slice: number;
  readonly level: number;
  readonly kind: number;
}

/** Something that can be shown once the first `packets` packets are there. */
export interface State {
  readonly level: number;
  readonly packets: number;
  readonly vertices: number;
  readonly faces: number;
  /** Distances from the finest mesh, as shares of the diagonal of its box. */
  readonly rms: number;
  readonly maximum: number;
}

export interface Header {
  readonly profile: "classic" | "compact";
  readonly effort: "default" | "high";
  /** Of a coordinate. */
  readonly bits: number;
  readonly origin: readonly [number, number, number];
  readonly extent: number;
  readonly packets: readonly Packet[];
  readonly states: readonly State[];
}

export const KINDS = ["Base", "Map&Conn", "Param", "Diff", "Preview", "Order"] as const;
/** Tells how the input's vertices and faces stood, which is of no use to a viewer. */
export const ORDER = 5;

const FAULTS: readonly ErrorCode[] = [
  "internal",
  "malformed",
  "limit",
  "memory",
  "internal",
  "version",
  "internal",
  "wasm",
];
/** The smaller file decodes no such stream. */
const UNSUPPORTED = 7;
const STATES = ["default.states", "high.states", "classic.states"] as const;
const SIZES = { packet: 16, state: 40 };

type Exports = Record<string, (...values: (number | bigint)[]) => number | bigint> & {
  memory: WebAssembly.Memory;
  mt_last_failure: WebAssembly.Global;
};

const modules = new Map<string, Promise<WebAssembly.Module>>();

/** The module of a file, compiled once. */
function compiled(name: string, files: Files): Promise<WebAssembly.Module> {
  let module = modules.get(name);
  if (module === undefined) {
    module = files(name).then((bytes) =>
      WebAssembly.compile(bytes).catch((error: unknown) => {
        throw errorOf("wasm", `this page may not run WebAssembly: ${error instanceof Error ? error.message : error}`);
      }),
    );
    module.catch(() => modules.delete(name)); // what failed is tried again
    modules.set(name, module);
  }
  return module;
}

/** A core that decodes the stream of a header: of the smaller file, unless that refuses it. */
export async function coreFor(header: Uint8Array, files: Files, limits: Partial<Limits>): Promise<Core> {
  const core = new Core(await compiled("meshtide.wasm", files), limits);
  try {
    core.parse(header);
    return core;
  } catch (error) {
    if (core.fault !== UNSUPPORTED) throw error;
  }
  const full = new Core(await compiled("meshtide-full.wasm", files), limits);
  full.parse(header);
  return full;
}

export class Core {
  /** Of mt_fault, once something has failed. */
  fault = 0;
  #failed: MeshtideError | undefined;
  readonly #exports: Exports;
  /** For what functions return through pointers; the limits stand behind it. */
  readonly #room: number;
  readonly #limits: number;
  #stream = 0;
  #decoder = 0;

  constructor(module: WebAssembly.Module, limits: Partial<Limits>) {
    this.#exports = new WebAssembly.Instance(module, {}).exports as Exports;
    this.#call("_initialize");
    this.#room = this.#allocate(128);
    this.#limits = this.#room + 48;
    const all: Limits = { ...LIMITS, ...limits };
    const names = Object.keys(LIMITS) as (keyof Limits)[];
    for (const [i, name] of names.entries()) this.#view().setBigUint64(this.#limits + 8 * i, BigInt(all[name]), true);
  }

  /** Bytes of the instance's memory. */
  get memoryBytes(): number {
    return this.#exports.memory.buffer.byteLength;
  }

  parse(header: Uint8Array): void {
    this.#lend(header, (pointer, size) => this.#call("mt_stream_parse", pointer, size, this.#limits, this.#room, 0));
    this.#stream = this.#view().getUint32(this.#room, true);
  }

  header(): Header {
    const fields = this.#number("mt_stream_header", this.#stream);
    const view = this.#view();
    const double = (at: number) => view.getFloat64(at, true);
    const count = (at: number) => Number(view.getBigUint64(at, true));
    const packets = view.getUint32(fields + 40, true);
    const states = view.getUint32(fields + 56, true);
    return {
      profile: view.getInt32(fields, true) === 0 ? "classic" : "compact",
      effort: view.getInt32(fields + 72, true) === 1 ? "high" : "default",
      bits: view.getInt32(fields + 4, true),
      origin: [double(fields + 8), double(fields + 16), double(fields + 24)],
      extent: double(fields + 32),
      packets: Array.from({ length: count(fields + 48) }, (_, i) => {
        const at = packets + SIZES.packet * i;
        return {
          length: count(at),
          checksum: view.getUint32(at + 8, true),
          slice: view.getUint16(at + 12, true),
          level: view.getUint8(at + 14),
          kind: view.getUint8(at + 15),
        };
      }),
      states: Array.from({ length: count(fields + 64) }, (_, i) => {
        const at = states + SIZES.state * i;
        return {
          vertices: count(at),
          faces: count(at + 8),
          rms: double(at + 16),
          maximum: double(at + 24),
          packets: view.getUint32(at + 32, true),
          level: view.getUint32(at + 36, true),
        };
      }),
    };
  }

  /** Makes it ready for packets; fetches the trained states that the stream needs. */
  async start(header: Header, files: Files): Promise<void> {
    const states = this.#number("mt_states_new");
    const efforts = header.profile === "classic" ? [2] : header.effort === "high" ? [0, 1] : [0]; // previews need 0
    for (const which of efforts) {
      const bytes = await files(STATES[which] as string);
      const given = ArrayBuffer.isView(bytes)
        ? new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength)
        : new Uint8Array(bytes);
      this.#lend(given, (pointer, size) => this.#call("mt_states_load", states, which, pointer, size, 0));
    }
    this.#call("mt_decoder_new", this.#stream, this.#limits, states, this.#room, 0);
    this.#decoder = this.#view().getUint32(this.#room, true);
  }

  push({ kind, level, slice }: Packet, payload: Uint8Array): void {
    this.#lend(payload, (pointer, size) =>
      this.#call("mt_decoder_push", this.#decoder, kind, level, slice, pointer, size, 0),
    );
  }

  isExact(level: number): boolean {
    return ((BigInt(this.#call("mt_decoder_exact", this.#decoder)) >> BigInt(level)) & 1n) === 1n;
  }

  isAvailable(level: number): boolean {
    return ((BigInt(this.#call("mt_decoder_available", this.#decoder)) >> BigInt(level)) & 1n) === 1n;
  }

  /** Positions in finest steps, and faces; lent until the next call. */
  show(level: number): { positions: Float64Array; faces: Int32Array } {
    this.#call("mt_decoder_show", this.#decoder, level, this.#room, 0);
    const view = this.#view();
    const count = (at: number) => Number(view.getBigUint64(this.#room + at, true));
    const { buffer } = this.#exports.memory;
    return {
      positions: new Float64Array(buffer, view.getUint32(this.#room, true), 3 * count(8)),
      faces: new Int32Array(buffer, view.getUint32(this.#room + 16, true), 3 * count(24)),
    };
  }

  /** Made anew for each use, since the memory grows. */
  #view(): DataView {
    return new DataView(this.#exports.memory.buffer);
  }

  #call(name: string, ...values: (number | bigint)[]): number | bigint {
    if (this.#failed !== undefined) throw this.#failed;
    const called = this.#exports[name];
    if (called === undefined)
      throw errorOf("wasm", `the decoder has no function ${name}: its files are not of one version`);
    try {
      return called(...values);
    } catch (error) {
      if (!(error instanceof WebAssembly.RuntimeError)) throw error;
      this.#failed = this.#failure(error);
      throw this.#failed;
    }
  }

  #number(name: string, ...values: (number | bigint)[]): number {
    return Number(this.#call(name, ...values));
  }

  #failure(trap: WebAssembly.RuntimeError): MeshtideError {
    const view = this.#view();
    const at = this.#exports.mt_last_failure.value as number;
    this.fault = view.getInt32(at, true);
    if (this.fault === 0) return errorOf("internal", `the decoder stopped without a reason: ${trap.message}`);
    const text = this.#text(view.getUint32(at + 4, true));
    const code = FAULTS[this.fault] ?? "internal";
    if (code === "limit") {
      const claimed = view.getBigUint64(at + 16, true); // 0 where the core does not know
      const allowed = view.getBigUint64(at + 24, true);
      if (claimed === 0n) return errorOf(code, `the stream needs ${text}`);
      return errorOf("limit", `the stream claims ${claimed} of ${text}, and the limit is ${allowed}`);
    }
    const offset = view.getBigInt64(at + 8, true);
    const place: Place = offset < 0n ? {} : { offset: Number(offset) };
    return errorOf(code, text, place);
  }

  #text(from: number): string {
    const bytes = new Uint8Array(this.#exports.memory.buffer, from);
    return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
  }

  #allocate(bytes: number): number {
    const pointer = this.#number("malloc", bytes);
    if (pointer === 0) throw errorOf("memory", "the browser has no memory left for this mesh");
    return pointer;
  }

  /** Calls `work` with bytes that stand in the core's memory meanwhile. */
  #lend(bytes: Uint8Array, work: (pointer: number, size: bigint) => void): void {
    const pointer = this.#allocate(bytes.length);
    new Uint8Array(this.#exports.memory.buffer).set(bytes, pointer);
    work(pointer, BigInt(bytes.length));
    this.#call("free", pointer);
  }
}
